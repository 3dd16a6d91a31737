// SPDX-License-Identifier: Apache-2.0
#include "braid/place_samples.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr double kFloor = 0.01;  // of squared brightness in the units of the methods, as in `compare`

Plane<float> relativeToBrightness(const MethodResult& result, double exposure) {
  const Rgb<float>& image = result.image.mean;
  const double floor = kFloor / (exposure * exposure);
  Plane<float> out(image.width(), image.height(), kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      double level = 0;
      for (size_t c = 0; c < 3; ++c) level += static_cast<double>(image[c][i]) / 3;
      const double relative = static_cast<double>(result.error[i]) / (level * level + floor);
      out[i] = std::isfinite(relative) ? static_cast<float>(std::clamp(relative, 0.0, 1e30)) : 0.0f;
    }
  });
  return out;
}

}  // namespace

std::string placementFor(const std::vector<std::string>& methods) { return methods.empty() ? "none" : "auto"; }

RelativeErrors errorsForPlacement(const std::string& placement) {
  if (placement == "none") return varianceOverBrightness;
  return [placement](const Estimates& half) {
    PipelineOptions options;
    options.roles.helpers = false;
    const PipelineResult result = runPipeline(half, {placement}, options);
    const PipelineOutput* made = result.find(placement);
    if (!made || !made->ran() || made->result.error.empty()) return varianceOverBrightness(half);
    return relativeToBrightness(made->result, result.exposure);
  };
}

}  // namespace braid
