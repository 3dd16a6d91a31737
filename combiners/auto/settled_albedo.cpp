// SPDX-License-Identifier: Apache-2.0
#include "combiners/auto/settled_albedo.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "combiners/denoise/pw/pw_filter.h"
#include "combiners/pixels/least_albedo.h"
#include "renderer/core/parallel.h"
#include "renderer/film/features.h"

namespace braid {

namespace {

constexpr PatchWelchNeighbours kNeighbours{4};
constexpr float kGuidance = 0.5f;
constexpr float kMostDeviations = 2;

bool hasNoise(const FeaturePlanes<Rgb<float>>& albedo) {
  if (albedo.mean.empty() || albedo.variance.empty()) return false;
  return std::ranges::any_of(albedo.variance.channel, [](const Plane<float>& plane) {
    return std::ranges::any_of(plane.data, [](float v) { return v > 0; });
  });
}

// The albedo as an image. Its noise is that of the normals, too, which therefore guide by half
// (combiners/EXPERIMENTS.md, Noise of the albedo).
Rgb<float> filteredAlbedo(const Features& features, uint64_t passes, const std::atomic<bool>* cancel) {
  Estimate noisy;
  noisy.mean = features.albedo.mean;
  noisy.variance = features.albedo.variance;
  noisy.passes = passes;
  Features guides;
  guides.normal.mean = features.normal.mean;
  for (Plane<float>& plane : guides.normal.mean.channel)
    for (float& v : plane.data) v *= kGuidance;
  guides.depth.mean = features.depth.mean;
  const PatchWelchInput input = patchWelchInput(noisy, &guides, true);
  return std::move(patchWelch(input, std::array{kPatchWelchThreshold}, kNeighbours, {}, cancel)[0][0]);
}

}  // namespace

void settleAlbedo(Estimate& image, const Rgb<float>& variance, const Features* features, uint64_t passes,
                  const std::atomic<bool>* cancel) {
  if (!features || !hasNoise(features->albedo)) return;
  const Rgb<float>& sampled = features->albedo.mean;
  const Rgb<float> settled = filteredAlbedo(*features, passes, cancel);
  if (cancel && cancel->load()) return;
  const Plane<float>& depth = features->depth.mean;
  parallelChunks(sampled.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float r = sampled[0][i], g = sampled[1][i], b = sampled[2][i];
      const bool surface = std::min({r, g, b}) >= 0 && std::max({r, g, b}) <= 1 && (depth.empty() || depth[i] != 0);
      for (size_t c = 0; c < 3 && surface; ++c) {
        const float factor = std::max(settled[c][i], kLeastAlbedo) / std::max(sampled[c][i], kLeastAlbedo);
        const float most = kMostDeviations * std::sqrt(std::max(variance[c][i], 0.0f));
        for (Rgb<float>* part : {&image.mean, &image.half[0], &image.half[1]})
          if (!part->empty()) (*part)[c][i] += std::clamp((factor - 1) * (*part)[c][i], -most, most);
      }
    }
  });
}

}  // namespace braid
