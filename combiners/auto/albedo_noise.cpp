// SPDX-License-Identifier: Apache-2.0
#include "combiners/auto/albedo_noise.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/finite_float.h"
#include "combiners/pixels/least_albedo.h"
#include "renderer/core/parallel.h"

namespace braid {

Plane<float> albedoNoise(const Rgb<float>& image, const Features* features) {
  if (!features || features->albedo.mean.empty()) return {};
  const FeaturePlanes<Rgb<float>>& albedo = features->albedo;
  const bool halves = !albedo.half[0].empty() && !albedo.half[1].empty();
  if (!halves && albedo.variance.empty()) return {};
  const auto variance = [&](size_t c, size_t i) {
    if (!halves) return static_cast<double>(albedo.variance[c][i]);
    return sqr(static_cast<double>(albedo.half[0][c][i]) - static_cast<double>(albedo.half[1][c][i])) / 4;
  };
  const Plane<float>& depth = features->depth.mean;
  Plane<float> noise(image.width(), image.height());
  parallelChunks(noise.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (!depth.empty() && depth[i] == 0) continue;
      double sum = 0;
      for (size_t c = 0; c < 3; ++c) {
        const auto divisor = static_cast<double>(std::max(albedo.mean[c][i], kLeastAlbedo));
        sum += sqr(static_cast<double>(image[c][i]) / divisor) * variance(c, i);
      }
      if (std::isfinite(sum)) noise[i] = finiteFloat(std::max(0.0, sum / 3));
    }
  });
  return noise;
}

}  // namespace braid
