// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/pw_tile.h"

#include <cmath>

#include "combiners/denoise/variance.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr float kMinAlbedo = 0.03f;
constexpr float kAlbedoSd = 0.25f, kNormalSd = 0.25f;
const float kAlbedoScale = std::sqrt(0.5f * kLog2E) / kAlbedoSd, kNormalScale = std::sqrt(0.5f * kLog2E) / kNormalSd;

float finiteOrZero(float v) { return std::isfinite(v) ? v : 0.0f; }

Vec3 finiteOrZero(const Vec3& v) { return Vec3(finiteOrZero(v.x), finiteOrZero(v.y), finiteOrZero(v.z)); }

// What radiance is divided by. The albedo of a miss is the radiance of the environment, that of an emitter contains its
// emission.
Vec3 divisorOf(const Features& features, size_t i) {
  const Plane<float>& depth = features.depth.mean;
  if (features.albedo.mean.empty() || (!depth.empty() && depth[i] == 0)) return Vec3(1);
  const Vec3 albedo = finiteOrZero(features.albedo.mean.pixel(i));
  return maxComponent(albedo) > 1 ? Vec3(1) : glm::max(albedo, Vec3(kMinAlbedo));
}

float inverseMeanDepth(const Features& features) {
  double sum = 0, count = 0;
  for (const float d : features.depth.mean.data)
    if (std::isfinite(d) && d > 0) {
      sum += static_cast<double>(d);
      ++count;
    }
  return sum > 0 ? static_cast<float>(count / sum) : 0.0f;
}

}  // namespace

PatchWelchInput patchWelchInput(const Estimate& estimate, const Features* features, bool robustVariance) {
  PatchWelchInput input;
  input.features = features;
  input.images = {&estimate.mean};
  if (!estimate.half[0].empty() && !estimate.half[1].empty()) {
    input.images.push_back(&estimate.half[0]);
    input.images.push_back(&estimate.half[1]);
  }
  input.variance = regularisedVariance(estimate, robustVariance);
  input.passes = passesOf(estimate);
  if (features) input.depthScale = inverseMeanDepth(*features);
  return input;
}

PatchWelchTile::PatchWelchTile(const PatchWelchInput& input, const PixelRect& pixels)
    : rect(pixels), pitch(pixels.width() + kPadding), radiance(input.images.size()) {
  BRAID_ASSERT(!input.variance.empty() && input.variance.size() == input.images[0]->size());
  const auto size = static_cast<size_t>(pitch) * static_cast<size_t>(rect.height() + 1);
  for (Plane3& image : radiance)
    for (std::vector<float>& plane : image) plane.assign(size, 0.0f);
  for (std::vector<float>& plane : variance) plane.assign(size, 0.0f);
  for (std::vector<float>& plane : divisor) plane.assign(size, 1.0f);
  for (std::vector<float>& plane : guide) plane.assign(size, 0.0f);
  depth.assign(size, 0.0f);
  visibility.assign(size, 0.0f);
  for (int y = rect.y0; y < rect.y1; ++y)
    for (int x = rect.x0; x < rect.x1; ++x) {
      const size_t i = input.variance[0].index(x, y);
      const auto at = static_cast<size_t>(index(x, y));
      const Vec3 a = input.features ? divisorOf(*input.features, i) : Vec3(1);
      if (input.features) storeFeatures(input, i, at);
      for (int c = 0; c < 3; ++c) {
        const auto channel = static_cast<size_t>(c);
        divisor[channel][at] = a[c];
        variance[channel][at] = input.variance[channel][i] / (a[c] * a[c]);
        for (size_t k = 0; k < radiance.size(); ++k)
          radiance[k][channel][at] = finiteOrZero((*input.images[k])[channel][i]) / a[c];
      }
    }
}

void PatchWelchTile::storeFeatures(const PatchWelchInput& input, size_t i, size_t at) {
  const Features& f = *input.features;
  for (size_t c = 0; c < 3; ++c) {
    if (!f.albedo.mean.empty()) guide[c][at] = kAlbedoScale * std::clamp(finiteOrZero(f.albedo.mean[c][i]), 0.0f, 1.0f);
    if (!f.normal.mean.empty()) guide[3 + c][at] = kNormalScale * finiteOrZero(f.normal.mean[c][i]);
  }
  if (!f.depth.mean.empty()) depth[at] = input.depthScale * finiteOrZero(f.depth.mean[i]);
  if (!f.visibility.mean.empty()) visibility[at] = finiteOrZero(f.visibility.mean[i]);
}

}  // namespace braid
