// SPDX-License-Identifier: Apache-2.0
// Variance and halves for images that come without: the first pass of a render, and one image of another renderer, of
// which nothing else is known. Neither is as good as what a render of more passes knows of itself
// (combiners/EXPERIMENTS.md, Variance of a single image).
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// An estimate of the variance of an image from the differences of its neighbouring pixels, which have to be
// independent: a box filter, or one that shares no samples between pixels.
//
// Second differences x0 - (x1 + x2) / 2 in four directions vanish on slopes; along an edge one of the directions sees
// noise alone, so the least of them counts. They are taken relative to the brightness, in proportion to which the noise
// of path tracing grows, so that lamps do not count as the noise of what they shine on, and averaged over 9 x 9 pixels
// by their square roots, so that single fireflies do not either; a pixel that stands out keeps its own difference.
// Albedos are divided out, and differences across edges of features are left out. Finite, >= 0, in the units of image².
Rgb<float> spatialVariance(const Rgb<float>& image, const Features* features);

// Two halves of an estimate with a mean and a variance: mean ± the same normal noise of that variance. They have the
// variance of halves, twice that of the mean; their mean is the mean; and for normal noise of known variance they are
// independent of each other (data fission, Leiner et al. 2023). `seed` chooses the noise; the channels of a pixel share
// it, as those of path tracing nearly do.
void makeHalves(Estimate& estimate, uint64_t seed = 0);

// The variance of the colours in 15x15 pixels about every pixel, along its surface (surface_smooth.h): what is left of
// one sample a pixel, most of which are black under light that few find. Finite, >= 0, in the units of image².
Rgb<float> scatterAlongSurfaces(const Rgb<float>& image, const Features* features);

// Gives unbiased estimates of a single pass, of which no render knows a variance or has halves, that variance and
// makeHalves(), so that every method runs on them, and passes of 0: not known, since neither is what counts of passes
// say.
void completeFirstPasses(Estimates& estimates, const Features* features);

}  // namespace braid
