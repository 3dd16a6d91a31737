// SPDX-License-Identifier: Apache-2.0
// Renders small scenes for statistical tests and compares what comes out.
//
// All seeds are fixed, so a test that passes keeps passing; the stated false-alarm rates are those of choosing seeds
// anew. "Within 4 standard errors" fails by chance once in 16,000.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "integrators/registry.h"
#include "renderer/session/session.h"
#include "tests/support/statistics/chi_squared.h"
#include "tools/bench/builtin_scenes.h"

namespace braid::test {

inline constexpr double kSigmas = 4;
// Rounding of float radiance, relative to the expected value; for results without variance.
inline constexpr double kRounding = 2e-5;

inline const std::vector<const Integrator*>& integrators() {
  static const std::vector<std::unique_ptr<Integrator>> owned = makeIntegrators();
  static const std::vector<const Integrator*> list = pointersTo(owned);
  return list;
}

inline Settings settingsFor(int width, int height, uint64_t spp, SamplerKind sampler = SamplerKind::Sobol) {
  Settings s;
  s.width = width;
  s.height = height;
  s.spp = spp;
  s.sampler = sampler;
  s.keep.features = false;
  return s;
}

inline RenderResult render(const Scene& scene, const Settings& settings) {
  return Session(scene, makePlan(scene, scene.data().cameras.at(0), settings, integrators())).run();
}

inline RenderResult render(SceneData data, const Settings& settings, const SceneOptions& options = {}) {
  return render(Scene(std::move(data), options), settings);
}

// A path of a file in the repository.
inline std::string sourcePath(const std::string& path) { return BRAID_SOURCE_DIR "/" + path; }

inline CameraData cameraAt(const Vec3& from, const Vec3& to, const Vec3& up = Vec3(0, 1, 0)) {
  CameraData camera;
  camera.toWorld = glm::inverse(glm::lookAt(from, to, up));
  return camera;
}

// Sees a spot of 2 · halfExtent metres about `to` under one angle.
inline CameraData spotCamera(const Vec3& from, const Vec3& to, float halfExtent, const Vec3& up = Vec3(0, 1, 0)) {
  CameraData camera = cameraAt(from, to, up);
  camera.orthographic = true;
  camera.xmag = camera.ymag = halfExtent;
  return camera;
}

// An estimate of one number.
struct Measured {
  double value = 0, error = 0;  // error: standard error
};

// Mean of one channel over a block of pixels, with the standard error from the reported variances: pixels are
// independent.
inline Measured meanOver(const RenderResult& result, size_t c, const PixelWindow& block) {
  const Estimate& e = result.estimates->estimates.front();
  double sum = 0, variance = 0;
  for (int y = block.y0; y < block.y1; ++y) {
    for (int x = block.x0; x < block.x1; ++x) {
      sum += static_cast<double>(e.mean[c].at(x, y));
      variance += static_cast<double>(e.variance[c].at(x, y));
    }
  }
  const double count = static_cast<double>(block.width()) * block.height();
  return {sum / count, std::sqrt(variance) / count};
}

inline Measured meanOf(const RenderResult& result, size_t c = 1) {
  return meanOver(result, c, {0, 0, result.estimates->width, result.estimates->height});
}

// Mean of all channels over renders with the seeds first, first + 1, …: the standard error of images whose pixels are
// not independent, as those that share photons.
inline Measured meanOverSeeds(const Scene& scene, Settings settings, int seeds, uint64_t first) {
  double sum = 0, squares = 0;
  for (int k = 0; k < seeds; ++k) {
    settings.seed = first + static_cast<uint64_t>(k);
    const RenderResult r = render(scene, settings);
    CHECK(r.rejected == 0);
    const double mean = (meanOf(r, 0).value + meanOf(r, 1).value + meanOf(r, 2).value) / 3;
    sum += mean / seeds;
    squares += mean * mean / seeds;
  }
  return {sum, std::sqrt(std::max(0.0, squares - sum * sum) / (seeds - 1))};
}

// Distance from an exact value in standard errors, rounding forgiven.
inline double zScore(const Measured& m, double expected) {
  const double distance = std::fabs(m.value - expected), rounding = kRounding * std::fabs(expected);
  return distance <= rounding ? 0.0 : (distance - rounding) / m.error;
}

inline double zScore(const Measured& a, const Measured& b) {
  return zScore({a.value - b.value + a.value, std::hypot(a.error, b.error)}, a.value);
}

inline std::vector<PixelWindow> blocksOf(const RenderResult& result, int size) {
  std::vector<PixelWindow> blocks;
  const int width = result.estimates->width, height = result.estimates->height;
  for (int y = 0; y < height; y += size)
    for (int x = 0; x < width; x += size)
      blocks.push_back({x, y, std::min(x + size, width), std::min(y + size, height)});
  return blocks;
}

// |z| that a standard normal variate exceeds with probability p, by bisection of erfc.
inline double normalQuantile(double p) {
  double lo = 0, hi = 40;
  for (int i = 0; i < 100; ++i) {
    const double mid = 0.5 * (lo + hi);
    (std::erfc(mid / std::sqrt(2.0)) > p ? lo : hi) = mid;
  }
  return lo;
}

// |z| that the largest of n independent scores exceeds with probability `overall`.
inline double zLimit(size_t n, double overall = 1e-4) { return normalQuantile(sidak(overall, static_cast<int>(n))); }

// Whether two renders have the same expectation: the largest z over square blocks of pixels and channels, divided by
// its limit at a false-alarm rate of 10⁻⁴.
inline double disagreement(const RenderResult& a, const RenderResult& b, int block = 4) {
  const std::vector<PixelWindow> blocks = blocksOf(a, block);
  double worst = 0;
  for (const PixelWindow& w : blocks)
    for (size_t c = 0; c < 3; ++c) worst = std::max(worst, zScore(meanOver(a, c, w), meanOver(b, c, w)));
  return worst / zLimit(3 * blocks.size());
}

inline bool sameBits(const Rgb<float>& a, const Rgb<float>& b) {
  if (a.width() != b.width() || a.height() != b.height()) return false;
  for (size_t c = 0; c < 3; ++c)
    if (std::memcmp(a[c].data.data(), b[c].data.data(), a[c].size() * sizeof(float)) != 0) return false;
  return true;
}

inline bool sameBits(const Estimate& a, const Estimate& b) {
  return sameBits(a.mean, b.mean) && sameBits(a.half[0], b.half[0]) && sameBits(a.half[1], b.half[1]);
}

inline const Estimate& estimateOf(const RenderResult& result) { return result.estimates->estimates.front(); }

}  // namespace braid::test
