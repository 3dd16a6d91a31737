// SPDX-License-Identifier: Apache-2.0
// Directional albedos of BSDFs, by their own samples.
#pragma once

#include <algorithm>

#include "renderer/transport/bsdf/bsdf.h"
#include "tests/support/statistics/chi_squared.h"

namespace braid::test {

struct Albedo {
  glm::dvec3 mean{0}, error{0};  // of the estimate, and its standard error
  float largestWeight = 0;
};

// Stratified in the two dimensions of direction.
inline Albedo sampledAlbedo(const Bsdf& bsdf, int side, bool withDelta, Rng& rng, float transmittedScale = 1) {
  glm::dvec3 sum(0), sum2(0);
  Albedo a;
  for (int i = 0; i < side * side; ++i) {
    BsdfSample s;
    const Vec2 cell(static_cast<float>(i % side), static_cast<float>(i / side));
    const float uLobe = rng.next();
    if (!bsdf.sample(uLobe, (cell + rng.next2()) / static_cast<float>(side), s) || (s.delta && !withDelta)) continue;
    if (s.transmitted) s.weight *= transmittedScale;
    const glm::dvec3 w(s.weight);
    sum += w;
    sum2 += w * w;
    a.largestWeight = std::max(a.largestWeight, maxComponent(s.weight));
  }
  const double n = side * side;
  a.mean = sum / n;
  a.error = glm::sqrt(glm::max(sum2 / n - a.mean * a.mean, 0.0) / n);
  return a;
}

// Of radiance, by `count` points of a lattice in three dimensions (Roberts 2018) instead of random ones: without noise.
inline double latticeAlbedo(const Bsdf& bsdf, int count) {
  constexpr double kRoot = 1.2207440846057596;  // of x⁴ = x + 1
  const glm::dvec3 step(1 / kRoot, 1 / (kRoot * kRoot), 1 / (kRoot * kRoot * kRoot));
  double sum = 0;
  for (int i = 0; i < count; ++i) {
    const Vec3 u = glm::min(Vec3(glm::fract(0.5 + static_cast<double>(i) * step)), Vec3(0.99999994f));
    BsdfSample s;
    if (bsdf.sample(u.z, {u.x, u.y}, s))
      sum += static_cast<double>(s.weight.y / (s.transmitted ? bsdf.radianceScale() : 1));
  }
  return sum / count;
}

// Of radiance, without its compression by refraction.
inline Albedo radianceAlbedo(const Bsdf& bsdf, int side, Rng& rng) {
  return sampledAlbedo(bsdf, side, true, rng, 1 / bsdf.radianceScale());
}

}  // namespace braid::test
