// SPDX-License-Identifier: Apache-2.0
// Errors against a reference that is noisy itself: with two independent halves of the reference its noise drops out.
#pragma once

#include <vector>

#include "renderer/core/plane.h"

namespace braid {

// Two independent, equally good estimates of the truth, and their mean. Without halves only the mean is set.
struct ReferenceImage {
  Rgb<float> mean, half[2];
  bool hasHalves() const { return !half[0].empty() && !half[1].empty(); }
};

// Relative squared error, mean over pixels and channels of (z - A)(z - B) / (mean_RGB(R)² + 0.01) with R the mean of
// the halves A and B: for z independent of both, E (z - A)(z - B) = E (z - truth)², so the reference's own noise adds
// nothing on average (tools/README.md, Errors against a noisy reference). May be negative where the noise of the
// reference exceeds the error. Pixels with a non-finite reference are left out; infinite when the image is not finite;
// NaN without halves.
double relL2Unbiased(const Rgb<float>& image, const ReferenceImage& reference);

// Mean over pixels and channels of squared bias / (mean_RGB(R)² + 0.01): with e_k the errors of N >= 2 independent
// runs, (Σ e_k)² - Σ e_k² over N (N - 1) has the mean bias² (products of different runs), and the halves of the
// reference keep its noise out as in relL2Unbiased(). May be negative where there is next to no bias. NaN without
// halves, infinite when an image is not finite. The standard error comes from the means of blocks of 16x16 pixels,
// which hold the correlation of neighbours; it leaves out what whole images share.
struct SquaredBias {
  double value = 0, standardError = 0;
};
SquaredBias relativeSquaredBias(const std::vector<Rgb<float>>& runs, const ReferenceImage& reference);

// What the noise of the reference's mean adds to relL2, on average: mean of ((A - B)/2)² / (mean_RGB(R)² + 0.01).
// NaN without halves.
double referenceNoise(const ReferenceImage& reference);

// How an image compares with a baseline pixel by pixel (James-Stein combiner, supplementary Fig. 19).
struct Dominance {
  double betterPixels = 0;       // fraction of the pixels whose squared error is below the baseline's
  double squaredDifference = 0;  // mean of squared error minus the baseline's, in units of radiance²
};
Dominance dominance(const Rgb<float>& image, const Rgb<float>& baseline, const Rgb<float>& reference);

}  // namespace braid
