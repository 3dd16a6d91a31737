// SPDX-License-Identifier: Apache-2.0
// Weights of an ensemble by relative errors, which relL2 counts: a squared error over the squared brightness. By errors
// as they are, the brightest pixel of a patch decides for all of it.
#pragma once

#include "combiners/ensemble/ensemble_weights.h"

namespace braid {

// Roots of the weights of pixels that make their errors relative, 1 / sqrt(level² + 0.01 + 0.3 v). The level is half
// the guide's own and half its 3x3 mean: the mean alone hides what a lamp's neighbours get wrong, and without it noise
// of the guide counts. Without any share of the variance v, single fireflies decide; with all of it, filters that keep
// fireflies go unpunished.
Plane<float> relativeErrorRoots(const Rgb<float>& guide, const Rgb<float>& variance);

// Weights of the candidates by errors relative to the brightness of `guide`: shared by the channels, summed over
// patches of (2 patchRadius + 1)² pixels, solved for blocks of 2x2 pixels and smoothed along surfaces. `variance` is
// that of the mean of x. All images have halves; the features may be absent.
WeightMaps relativeWeights(const Estimate& x, const std::vector<const Estimate*>& candidates, const Rgb<float>& guide,
                           const Rgb<float>& variance, const Features* features, int patchRadius);

}  // namespace braid
