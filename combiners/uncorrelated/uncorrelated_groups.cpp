// SPDX-License-Identifier: Apache-2.0
#include "combiners/uncorrelated/uncorrelated_groups.h"

#include <algorithm>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/statistics/variance.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

// 2^15 pixels vote, or as many more as it takes for the windows of their rows to cover the image.
double chosenGamma(const MethodInputs& in, const OptionInfo& option, const UncorrelatedInputs (&groups)[2]) {
  const double wanted = in.options.number(option);
  if (wanted >= 0) return wanted;
  constexpr size_t kVotes = 1 << 15, kWindow = 15;
  const size_t step = std::clamp<size_t>(in.unbiased->mean.size() / kVotes, 1, kWindow);
  return bestGamma(uncorrelatedScores(groups, in.unbiased->mean, static_cast<int>(step)));
}

}  // namespace

Needs uncorrelatedNeeds() {
  Needs needs;
  needs.correlated = needs.quarters = true;
  needs.passes = 4;
  needs.variance = false;
  return needs;
}

OptionInfo gammaOption(const std::string& method) {
  return {method + "-gamma", -1, "Sensitivity of the weights to noise; negative: chosen by variance", -1, 1e9, false};
}

UncorrelatedInputs uncorrelatedGroup(const Estimate& y, const Estimate& z, size_t independentHalf,
                                     size_t correlatedHalf, size_t weights, const NoiseChoice& noise) {
  return {&y.half[independentHalf],
          &z.half[correlatedHalf],
          &z.quarter[weights],
          &z.quarter[weights + 2],
          static_cast<double>(passesOf(z)) / 4,
          noise.levels,
          noise.most};
}

double filterGroups(const MethodInputs& in, const OptionInfo& option, const UncorrelatedInputs (&groups)[2],
                    MethodResult& result) {
  const double gamma = chosenGamma(in, option, groups);
  for (int h = 0; h < 2; ++h) result.image.half[h] = uncorrelatedFiltered(groups[h], gamma);
  result.remarks.push_back(numberAttribute("gamma", gamma));
  return gamma;
}

Plane<float> halvesVariance(const Rgb<float> (&halves)[2]) {
  Plane<float> out(halves[0].width(), halves[0].height());
  for (size_t i = 0; i < out.size(); ++i) {
    double sum = 0;
    for (size_t c = 0; c < 3; ++c)
      sum += sqr(static_cast<double>(halves[0][c][i]) - static_cast<double>(halves[1][c][i])) / 12;
    out[i] = finiteFloat(sum);
  }
  const Plane<double> mean = boxMean(out, 3);
  for (size_t i = 0; i < out.size(); ++i) out[i] = finiteFloat(mean[i]);
  return out;
}

}  // namespace braid
