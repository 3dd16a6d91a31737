// SPDX-License-Identifier: Apache-2.0
#include "combiners/shrinkage/optimised_bias.h"

#include <utility>

#include "combiners/regression/colour_weights.h"
#include "combiners/regression/regression_features.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr float kEpsilon = 0.01f;  // of Eq. 10

double halfDifference(const Estimate& e) {
  const double sum = parallelSum(e.half[0].size(), kPixelChunk, 0.0, [&](size_t begin, size_t end) {
    double part = 0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i) {
        const double d = static_cast<double>(e.half[0][c][i]) - static_cast<double>(e.half[1][c][i]);
        part += d * d / 2;
      }
    return part;
  });
  return sum / (3.0 * static_cast<double>(e.half[0].size()));
}

}  // namespace

Rgb<float> OptimisedBias::mean() const { return average(crossed[0], crossed[1]); }

OptimisedBias optimisedBias(const Estimate& unbiased, const Estimate& biased, const Features* features,
                            const RegressionSettings& settings) {
  OptimisedBias result;
  result.bandwidth = halfDifference(biased);
  for (const size_t h : {size_t(0), size_t(1)}) {
    const Rgb<float>& y = biased.half[h];
    const RegressionFeatures planes(features, h == 0 ? Samples::HalfA : Samples::HalfB);
    const ColourWeights weights(y, static_cast<float>(2 * result.bandwidth) + kEpsilon);
    RegressionInputs inputs;
    inputs.features = planes.groups();
    inputs.features.insert(inputs.features.begin(), {&y[0], &y[1], &y[2]});
    inputs.terms = {{&unbiased.half[1 - h], &weights, &unbiased.half[h]}};
    inputs.fallback = inputs.secondFallback = &y;
    auto [crossed, own] = regressTwo(inputs, settings, &result.report);
    result.crossed[1 - h] = std::move(crossed);
    result.own[h] = std::move(own);
  }
  return result;
}

}  // namespace braid
