// SPDX-License-Identifier: Apache-2.0
// What the methods of uncorrelated weighting share: the groups of quarters, and the search for gamma.
#pragma once

#include <algorithm>
#include <string>

#include "combiners/statistics/variance.h"
#include "combiners/uncorrelated/uncorrelated_filter.h"
#include "combiners/method.h"

namespace braid {

// By what neighbours are left out; see UncorrelatedInputs.
struct NoiseChoice {
  const Rgb<float>* levels = nullptr;
  double most = 0;
};

// Half `values` of both images, combined with weights from the two quarters of half `weights` of the correlated image:
// quarters 0 and 2 make half 0. The halves of the images are used as the means of the pairs of quarters, for they are
// right even if the quarters differ in passes.
inline UncorrelatedInputs uncorrelatedGroup(const Estimate& y, const Estimate& z, size_t independentHalf,
                                            size_t correlatedHalf, size_t weights, const NoiseChoice& noise = {}) {
  return {&y.half[independentHalf],
          &z.half[correlatedHalf],
          &z.quarter[weights],
          &z.quarter[weights + 2],
          static_cast<double>(passesOf(z)) / 4,
          noise.levels,
          noise.most};
}

// The option when it is set, or else the best gamma for these groups. 2^15 pixels vote, or as many more as it takes for
// the windows of their rows to cover the image.
inline double chosenGamma(const MethodInputs& in, const OptionInfo& option, const UncorrelatedInputs (&groups)[2]) {
  const double wanted = in.options.number(option);
  if (wanted >= 0) return wanted;
  constexpr size_t kVotes = 1 << 15, kWindow = 15;
  const size_t step = std::clamp<size_t>(in.unbiased->mean.size() / kVotes, 1, kWindow);
  return bestGamma(uncorrelatedScores(groups, in.unbiased->mean, static_cast<int>(step)));
}

// The error of an image whose halves are independent and whose bias is negligible: (A - B)² / 4, averaged over channels
// and over 7x7 pixels.
Plane<float> halvesVariance(const Rgb<float> (&halves)[2]);

inline Attribute gammaRemark(double gamma) {
  Attribute remark;
  remark.name = "gamma";
  remark.kind = Attribute::Kind::Float;
  remark.number = gamma;
  return remark;
}

}  // namespace braid
