// SPDX-License-Identifier: Apache-2.0
#include "combiners/fused_estimate.h"

#include <algorithm>
#include <cmath>

#include "combiners/box_mean.h"
#include "combiners/channel_mean.h"
#include "combiners/double_shrinkage.h"
#include "combiners/ensemble_weights.h"
#include "combiners/error_map.h"
#include "combiners/finite_float.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kRadius = 6;

// Shares that sum to 1, proportional to the inverses of the errors.
WeightMaps inverseErrorWeights(const std::vector<Plane<float>>& errors) {
  WeightMaps weights = uniformWeights(errors.size(), 1, errors[0].width, errors[0].height);
  parallelChunks(errors[0].size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      double sum = 0;
      for (const Plane<float>& e : errors) sum += 1 / std::max(static_cast<double>(e[i]), 1e-30);
      for (size_t k = 0; k < errors.size(); ++k)
        weights.of(k, 0)[i] = static_cast<float>(1 / (std::max(static_cast<double>(errors[k][i]), 1e-30) * sum));
    }
  });
  return weights;
}

// Raises E_u where the unbiased image is darker than the photon map over a whole window: rare paths have not been found
// there, and a variance knows nothing of samples that never came. The difference D of the window means must be beyond
// the photon map's error and three deviations of the unbiased mean; these are added as roots, for the former may be a
// bias, of which noise takes nothing away. Then D² - E_b is the squared error that E_b does not explain. D² would count
// it twice, which a photon map that is far off and says so turns into half of its image.
void countMissingLight(Plane<float>& error, const Estimate& unbiased, const Rgb<float>& variance,
                       const Estimate& biased, const Plane<float>& biasedError) {
  const auto value = [](const Rgb<float>& image) {
    return [&image](size_t i, size_t c) { return static_cast<double>(image[c][i]); };
  };
  const Plane<double> x = boxMean(channelMean(variance, value(unbiased.mean)), kRadius);
  const Plane<double> s = boxMean(channelMean(variance, value(biased.mean)), kRadius);
  const Plane<double> v = boxMean(channelMean(variance, value(variance)), kRadius);
  const double pixels = (2.0 * kRadius + 1) * (2.0 * kRadius + 1);
  for (size_t i = 0; i < error.size(); ++i) {
    const double missing = s[i] - x[i], explained = static_cast<double>(biasedError[i]);
    if (missing > std::sqrt(explained) + 3 * std::sqrt(v[i] / pixels))
      error[i] = std::max(error[i], finiteFloat(missing * missing - explained));
  }
}

// What of a photon map's squared error is not noise.
Plane<float> squaredBiasOf(const Estimate& biased, const Plane<float>& error) {
  const Rgb<float> variance = meanVariance(biased);
  const Plane<double> noise =
      boxMean(channelMean(variance, [&](size_t i, size_t c) { return static_cast<double>(variance[c][i]); }), kRadius);
  Plane<float> out(error.width, error.height);
  for (size_t i = 0; i < out.size(); ++i) out[i] = finiteFloat(std::max(0.0, static_cast<double>(error[i]) - noise[i]));
  return out;
}

double squaredShare(const WeightMaps& weights, size_t k, size_t i) {
  const auto w = static_cast<double>(weights.of(k, 0)[i]);
  return w * w;
}

// The variance of the combination, to which the squared errors of photon maps count whole.
Rgb<float> combinedVariance(const WeightMaps& weights, const Rgb<float>& variance,
                            const std::vector<Plane<float>>& errors) {
  Rgb<float> out(variance.width(), variance.height());
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      double photons = 0;
      for (size_t k = 1; k < errors.size(); ++k)
        photons += squaredShare(weights, k, i) * static_cast<double>(errors[k][i]);
      for (size_t c = 0; c < 3; ++c)
        out[c][i] = finiteFloat(squaredShare(weights, 0, i) * static_cast<double>(variance[c][i]) + photons);
    }
  });
  return out;
}

}  // namespace

FusedEstimate fusedEstimate(const Estimate& unbiased, const std::vector<const Estimate*>& biased,
                            const Features* features) {
  if (biased.empty()) return {unbiased, {}};
  const Rgb<float> variance = meanVariance(unbiased);
  std::vector<const Estimate*> inputs = {&unbiased};
  std::vector<Plane<float>> errors = {unbiasedError(unbiased, variance)};
  for (const Estimate* b : biased) {
    inputs.push_back(b);
    errors.push_back(biasedError(*b, unbiased, variance, features));
    countMissingLight(errors[0], unbiased, variance, *b, errors.back());
  }
  const WeightMaps weights = inverseErrorWeights(errors);
  FusedEstimate out{weightedEstimate(weights, inputs), Plane<float>(variance.width(), variance.height())};
  out.image.name = unbiased.name;
  out.image.correlation = unbiased.correlation;
  out.image.passes = unbiased.passes;
  if (std::all_of(inputs.begin(), inputs.end(), [](const Estimate* e) { return e->quarter.size() == 4; }))
    for (size_t q = 0; q < 4; ++q) {
      std::vector<const Rgb<float>*> quarters;
      for (const Estimate* e : inputs) quarters.push_back(&e->quarter[q]);
      out.image.quarter.push_back(weightedImage(weights, quarters));
    }
  out.image.variance = combinedVariance(weights, variance, errors);
  for (size_t k = 1; k < inputs.size(); ++k) {
    const Plane<float> bias = squaredBiasOf(*inputs[k], errors[k]);
    for (size_t i = 0; i < bias.size(); ++i)
      out.squaredBias[i] += static_cast<float>(squaredShare(weights, k, i)) * bias[i];
  }
  return out;
}

}  // namespace braid
