// SPDX-License-Identifier: Apache-2.0
// Charlie sheen (Conty Estevez & Kulla 2017, "Production Friendly Microfacet Sheen BRDF"), as in KHR_materials_sheen.
#pragma once

#include <algorithm>
#include <cmath>

#include "renderer/core/vec.h"
#include "renderer/transport/bsdf/warp.h"

namespace braid {

struct Charlie {
  // TRAP: roughness 0 has no limit distribution, only ever brighter grazing rims; below this it is held.
  static constexpr float kMinRoughness = 0.07f;

  float alpha;
  float a, b, c, d, e;  // the fitted masking curve at this alpha
  float logLambdaHalf;  // its value at cosine 1/2

  Charlie() = default;
  explicit Charlie(float roughness) : alpha(sqr(std::max(roughness, kMinRoughness))) {
    const float t = sqr(1 - alpha);
    a = glm::mix(21.5473f, 25.3245f, t);
    b = glm::mix(3.82987f, 3.32435f, t);
    c = glm::mix(0.19823f, 0.16801f, t);
    d = glm::mix(-1.97760f, -1.27393f, t);
    e = glm::mix(-4.32054f, -4.85967f, t);
    logLambdaHalf = curve(0.5f);
  }

  float curve(float x) const { return a / (1 + b * std::pow(x, c)) + d * x + e; }

  float lambda(float cosine) const {
    return std::exp(cosine < 0.5f ? curve(cosine) : 2 * logLambdaHalf - curve(std::max(1 - cosine, 0.0f)));
  }

  float D(float sin2H) const { return (2 + 1 / alpha) * std::pow(std::max(sin2H, 0.0f), 0.5f / alpha) * kInvTwoPi; }

  // f · cosI, with F = 1 and white colour.
  float evaluate(const Vec3& wo, const Vec3& wi) const {
    const Vec3 h = glm::normalize(wo + wi);
    return D(sqr(h.x) + sqr(h.y)) / (4 * wo.z * (1 + lambda(wo.z) + lambda(wi.z)));
  }
};

}  // namespace braid
