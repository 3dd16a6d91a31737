// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/kpn/kpn_planes.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/least_albedo.h"
#include "combiners/pixels/mean_depth.h"
#include "renderer/core/parallel.h"
#include "renderer/core/vec.h"

namespace braid {

namespace {

// Deviations are relative to the brightness around, which is rarely less.
constexpr float kDark = 0.01f;

// The planes of the network by what they hold.
enum Input {
  Radiance = 0,
  Near = 3,
  Far,
  Deviation,
  NearDeviation,
  Albedo,
  Normal = 10,
  Depth = 13,
  Visibility,
  Miss,
  FeatureNoise,
  Passes
};

float compressed(float radiance) { return 0.5f * std::log1p(4 * std::max(radiance, 0.0f)); }
float compressedDeviation(float relative) { return 0.25f * std::log2(relative + 0.002f); }

template <class Body>
void eachPixel(size_t count, const Body& body) {
  parallelChunks(count, kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) body(i);
  });
}

float orZero(const Plane<float>& plane, size_t i) { return plane.empty() ? 0.0f : plane[i]; }

// The albedo of a miss is the radiance of the environment, that of an emitter contains its emission.
bool isSurface(const Features& f, size_t i) {
  const Rgb<float>& albedo = f.albedo.mean;
  return std::max({albedo[0][i], albedo[1][i], albedo[2][i]}) <= 1 && (f.depth.mean.empty() || f.depth.mean[i] != 0);
}

// What the radiance is divided by, and its luminance and that of its deviation.
void demodulate(const Rgb<float>& image, const KpnScene& scene, float varianceFactor, KpnPlanes& out) {
  const Features* f = scene.features && !scene.features->albedo.mean.empty() ? scene.features : nullptr;
  eachPixel(image.size(), [&](size_t i) {
    const bool surface = f && isSurface(*f, i);
    Spectrum deviation;
    for (size_t c = 0; c < 3; ++c) {
      const float divisor = surface ? std::max(f->albedo.mean[c][i], kLeastAlbedo) : 1.0f;
      out.divisor[c][i] = divisor;
      out.irradiance[c][i] = image[c][i] / divisor;
      deviation[static_cast<int>(c)] = std::sqrt(std::max(scene.variance[c][i], 0.0f)) / divisor;
      out.input[Radiance + c][i] = compressed(out.irradiance[c][i]);
    }
    // Light is noisy in all channels at once.
    const float light = luminance(deviation);
    out.variance[i] = std::min(varianceFactor * light * light, 1e18f);
    out.input[Miss][i] = surface ? 0.0f : 1.0f;
  });
}

void describeLight(KpnPlanes& out) {
  Plane<float> light(out.width(), out.height(), kUnfilled);
  eachPixel(light.size(), [&](size_t i) {
    const Rgb<float>& e = out.irradiance;
    light[i] = luminance(glm::max(Spectrum(e[0][i], e[1][i], e[2][i]), Spectrum(0)));
  });
  const Plane<float> near = boxMean<float>(light, 2), far = boxMean<float>(light, 8),
                     nearVariance = boxMean<float>(out.variance, 2);
  eachPixel(light.size(), [&](size_t i) {
    const float level = std::max(near[i], 0.0f) + kDark;
    out.input[Near][i] = compressed(near[i]);
    out.input[Far][i] = compressed(far[i]);
    out.input[Deviation][i] = compressedDeviation(std::sqrt(out.variance[i]) / level);
    out.input[NearDeviation][i] = compressedDeviation(std::sqrt(std::max(nearVariance[i], 0.0f)) / level);
  });
}

float noiseOf(const Features& f, size_t i) {
  float sum = 0;
  for (size_t c = 0; c < 3; ++c) sum += orZero(f.albedo.variance[c], i) + orZero(f.normal.variance[c], i);
  return compressedDeviation(std::sqrt(std::clamp(sum, 0.0f, 3.0f)));
}

void describeFeatures(const Features& f, KpnPlanes& out) {
  const float depthScale = inverseMeanDepth(f.depth.mean);
  eachPixel(out.variance.size(), [&](size_t i) {
    for (size_t c = 0; c < 3; ++c) {
      out.input[Albedo + c][i] = std::clamp(orZero(f.albedo.mean[c], i), 0.0f, 1.0f);
      out.input[Normal + c][i] = std::clamp(orZero(f.normal.mean[c], i), -1.0f, 1.0f);
    }
    out.input[Depth][i] = std::log1p(std::clamp(orZero(f.depth.mean, i) * depthScale, 0.0f, 1e3f));
    out.input[Visibility][i] = std::clamp(orZero(f.visibility.mean, i), 0.0f, 1.0f);
    out.input[FeatureNoise][i] = noiseOf(f, i);
  });
}

}  // namespace

KpnPlanes kpnPlanes(const Rgb<float>& image, const KpnScene& scene, bool half) {
  const int w = image.width(), h = image.height();
  KpnPlanes out;
  out.irradiance = out.divisor = Rgb<float>(w, h);
  out.variance = Plane<float>(w, h);
  for (Plane<float>& plane : out.input) plane = Plane<float>(w, h, 0.0f);
  demodulate(image, scene, half ? 2.0f : 1.0f, out);
  describeLight(out);
  if (scene.features) describeFeatures(*scene.features, out);
  const uint64_t passes = std::max<uint64_t>(1, half ? scene.passes / 2 : scene.passes);
  const float passesPlane = static_cast<float>(std::log2(static_cast<double>(passes)) / 8);
  std::fill(out.input[Passes].data.begin(), out.input[Passes].data.end(), passesPlane);
  return out;
}

}  // namespace braid
