// SPDX-License-Identifier: Apache-2.0
// Estimates of the squared error of an image from its halves and the unbiased halves.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// The variance of the mean: the estimate's own, or (A - B)² / 4 where it brings none.
Rgb<float> meanVariance(const Estimate& estimate);

// Unbiased but noisy: the squared error of `image` at every pixel, averaged over channels,
//   ½ [(z_A - x_B)² + (z_B - x_A)²] - 2 v - ¼ (z_A - z_B)²,
// where v is the variance of the mean x: z_A has seen no sample of x_B, whose variance is 2 v, and the last term turns
// the error of a half into that of the mean of both. May be negative.
Plane<float> squaredErrorSamples(const Rgb<float> (&halves)[2], const Estimate& unbiased, const Rgb<float>& variance);

// The smoothed map: box3 of the variance ¼ (z_A - z_B)² plus the squared bias, if positive, box15(w (sample - ¼ (z_A -
// z_B)²)) / box15(w), where w = 1 / (box3(mean of `guide`)² + 0.01 + v) is the weight of the relative error
// (ALGORITHMS-BEYOND 8.3, steps 2 and 7). Its sum over the image is meant, not its pixels: where it is smallest it is
// too small, by selection. The halves must be independent of each other.
Plane<float> errorMap(const Rgb<float> (&halves)[2], const Estimate& unbiased, const Rgb<float>& variance,
                      const Rgb<float>& guide);

}  // namespace braid
