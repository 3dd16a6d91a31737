// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble/relative_weights.h"

#include <cmath>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/channel_mean.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/ensemble/weight_bilateral.h"

namespace braid {

namespace {

constexpr double kVarianceShare = 0.3;  // of a pixel's scale
// Weights are solved for blocks of so many pixels in x and y (combiners/EXPERIMENTS.md, Choices of auto).
constexpr int kStride = 2;
constexpr double kImprovement = 1e-5;  // weights to 1e-9 of the error change nothing

}  // namespace

Plane<float> relativeErrorRoots(const Rgb<float>& guide, const Rgb<float>& variance) {
  const Plane<float> own = channelMean(guide);
  const Plane<float> around = boxMean<float>(own, 1);
  const Plane<float> noise = channelMean(variance);
  Plane<float> out(guide.width(), guide.height(), kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double level = 0.5 * (static_cast<double>(own[i]) + static_cast<double>(around[i]));
      out[i] = finiteFloat(1 / std::sqrt(level * level + 0.01 + kVarianceShare * static_cast<double>(noise[i])));
    }
  });
  return out;
}

WeightMaps relativeWeights(const Estimate& x, const std::vector<const Estimate*>& candidates, const Rgb<float>& guide,
                           const Rgb<float>& variance, const Features* features, int patchRadius) {
  const Plane<float> roots = relativeErrorRoots(guide, variance);
  EnsembleChoices choices;
  choices.patchRadius = patchRadius;
  choices.rootWeights = &roots;
  choices.stride = kStride;
  choices.improvement = kImprovement;
  choices.shared = true;
  const WeightMaps raw = ensembleWeights(x, candidates, choices);
  return filteredWeights(raw, weightedEstimate(raw, candidates), features, kStride);
}

}  // namespace braid
