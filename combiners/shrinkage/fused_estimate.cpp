// SPDX-License-Identifier: Apache-2.0
#include "combiners/shrinkage/fused_estimate.h"

#include <algorithm>

#include "combiners/pixels/channel_mean.h"
#include "combiners/shrinkage/shrinkage_errors.h"
#include "combiners/ensemble/ensemble_weights.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/finite_float.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

// Photon maps find the bias of curved irradiance in full, but 0.41 of its square at edges of light
// (integrators/README.md, Bias of photon maps), and filters take away later what noise adds here, but not what bias
// does: squared biases count twice (combiners/EXPERIMENTS.md, Bias of photon maps counts twice).
constexpr double kUnestimatedBias = 2;

Plane<float> withUnestimated(Plane<float> squaredBias) {
  for (float& b : squaredBias.data) b = finiteFloat(kUnestimatedBias * static_cast<double>(b));
  return squaredBias;
}

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

double squaredShare(const WeightMaps& weights, size_t k, size_t i) {
  const auto w = static_cast<double>(weights.of(k, 0)[i]);
  return w * w;
}

// Adds what of the variance of the k-th image is left in the combination. That of the pixel itself: smoothed, a
// firefly's would make noise of its clean neighbours, which filters would then replace by the firefly.
void addVariance(Rgb<float>& sum, const WeightMaps& weights, size_t k, const Rgb<float>& variance) {
  parallelChunks(sum.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i)
        sum[c][i] = finiteFloat(static_cast<double>(sum[c][i]) +
                                squaredShare(weights, k, i) * static_cast<double>(variance[c][i]));
  });
}

// The same of a squared bias, for one plane.
void addSquaredBias(Plane<float>& sum, const WeightMaps& weights, size_t k, const Plane<float>& squaredBias) {
  parallelChunks(sum.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      sum[i] =
          finiteFloat(static_cast<double>(sum[i]) + squaredShare(weights, k, i) * static_cast<double>(squaredBias[i]));
  });
}

}  // namespace

FusedEstimate fusedEstimate(const Estimate& unbiased, const std::vector<const Estimate*>& biased,
                            const Features* features) {
  if (biased.empty()) return {unbiased, {}, {}};
  const Rgb<float> variance = meanVariance(unbiased);
  const int width = variance.width(), height = variance.height();
  std::vector<const Estimate*> inputs = {&unbiased};
  std::vector<Plane<float>> errors = {unbiasedError(unbiased, variance)}, squaredBiases;
  for (const Estimate* b : biased) {
    inputs.push_back(b);
    PhotonMapError error = photonMapError(*b, features, &unbiased);
    countMissingLight(errors[0], unbiased, variance, *b, totalError(*b, error));
    error.squaredBias = withUnestimated(std::move(error.squaredBias));
    errors.push_back(totalError(*b, error));
    squaredBiases.push_back(std::move(error.squaredBias));
  }
  const WeightMaps weights = inverseErrorWeights(errors);
  FusedEstimate out{weightedEstimate(weights, inputs), Rgb<float>(width, height), Plane<float>(width, height)};
  out.image.name = unbiased.name;
  out.image.correlation = unbiased.correlation;
  out.image.passes = unbiased.passes;
  if (std::all_of(inputs.begin(), inputs.end(), [](const Estimate* e) { return e->quarter.size() == 4; }))
    for (size_t q = 0; q < 4; ++q) {
      std::vector<const Rgb<float>*> quarters;
      for (const Estimate* e : inputs) quarters.push_back(&e->quarter[q]);
      out.image.quarter.push_back(weightedImage(weights, quarters));
    }
  addVariance(out.noise, weights, 0, variance);
  Plane<float> claimed(width, height);
  for (size_t k = 1; k < inputs.size(); ++k) {
    addVariance(out.noise, weights, k, meanVariance(*inputs[k]));
    addSquaredBias(out.squaredBias, weights, k, withUnestimated(squaredBiasSamples(*inputs[k])));
    addSquaredBias(claimed, weights, k, squaredBiases[k - 1]);
  }
  out.image.variance = out.noise;
  for (Plane<float>& plane : out.image.variance.channel)
    for (size_t i = 0; i < claimed.size(); ++i)
      plane[i] = finiteFloat(static_cast<double>(plane[i]) + static_cast<double>(claimed[i]));
  return out;
}

}  // namespace braid
