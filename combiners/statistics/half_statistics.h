// SPDX-License-Identifier: Apache-2.0
// Estimates of the squared error of an image from its halves and the unbiased halves.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// The variance of the mean: the estimate's own, or (A - B)² / 4 where it brings none.
Rgb<float> meanVariance(const Estimate& estimate);

// Name, passes, mean, halves and meanVariance() of the estimate: what filters and combiners read of it.
Estimate filterInput(const Estimate& estimate);

bool hasHalves(const Estimate& estimate);

// The variance of half h (0 or 1), as far as combiners should trust it. Both halves together have 4 v, where v is the
// variance of the mean; it is shared out by the squares of their values: twice v for halves that agree, all of it for
// the one that holds a firefly. With 2 v for both, a half would keep part of a firefly that the result is rid of, and
// errors measured across halves would be those of worse images.
Rgb<float> halfVariance(const Estimate& estimate, const Rgb<float>& variance, int h);

// Unbiased but noisy: the squared error of `image` at every pixel, averaged over channels,
//   ½ [(z_A - x_B)² + (z_B - x_A)²] - 2 v - ¼ (z_A - z_B)²,
// where v is the variance of the mean x: z_A has seen no sample of x_B, whose variance is 2 v, and the last term turns
// the error of a half into that of the mean of both. May be negative.
Plane<float> squaredErrorSamples(const Rgb<float> (&halves)[2], const Estimate& unbiased, const Rgb<float>& variance);

// The smoothed map: u (box3(¼ (z_A - z_B)² / u) + max(0, box15((sample - ¼ (z_A - z_B)²) / (u + v)))), the variance and
// the squared bias, with u = (mean of `guide`)² + 0.01. Both are averaged as relative errors: a lamp would lend the
// dark pixels around it an error that is beyond anything that they can have. Its sum over the image is meant, not its
// pixels: where it is smallest it is too small, by selection. The halves must be independent of each other.
Plane<float> crossHalfErrorMap(const Rgb<float> (&halves)[2], const Estimate& unbiased, const Rgb<float>& variance,
                               const Rgb<float>& guide);

// The map of an image that is mixed, as its errors ask for it, of the unbiased image and of what filters make of it:
//   u box3(s / u) / sqrt(1 / C + box15(s / u) / box15(v / u)),      s = ¼ (z_A - z_B)², C = 49,
// but at least u box3(s / u). v is the variance of the unbiased image (combiners/README.md, Errors across halves). It
// needs no halves but the image's own, and holds from four samples on. `shared` is a squared error of what filters make
// that both halves share (auto/albedo_noise.h), or empty: (1 - √(box15(s / u) / box15(v / u)))² of it are added.
Plane<float> mixtureErrorMap(const Rgb<float> (&halves)[2], const Rgb<float>& variance, const Rgb<float>& guide,
                             const Plane<float>& shared = {});

// u max(0, box15(squaredBias / u)), u as above: of unbiased samples of a squared bias, which may be negative.
Plane<float> smoothedSquaredBias(const Plane<float>& squaredBias, const Rgb<float>& guide);

}  // namespace braid
