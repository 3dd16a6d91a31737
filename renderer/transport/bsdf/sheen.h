// SPDX-License-Identifier: Apache-2.0
// Charlie sheen (Conty Estevez & Kulla 2017, "Production Friendly Microfacet Sheen BRDF"), as in KHR_materials_sheen.
#pragma once

#include <algorithm>
#include <cmath>

#include "renderer/core/vec.h"
#include "renderer/scene/data/lobes.h"
#include "renderer/transport/bsdf/albedo_tables.h"
#include "renderer/transport/bsdf/cover.h"
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

struct SheenParameters {
  Spectrum sheenColor{0};
  float sheenRoughness = 0;
};

class Sheen : public CoverLobe {
 public:
  using Parameters = SheenParameters;
  static constexpr uint32_t kLobe = kLobeSheen;
  static constexpr bool kAlwaysBroad = true;

  template <class Point>
  static void read(const Point& at, Parameters& p) {
    const Material& m = at.material();
    p.sheenColor = m.sheenColor * (m.sheenColorTexture ? Spectrum(at.texture(m.sheenColorTexture)) : Spectrum(1));
    p.sheenRoughness = m.sheenRoughness * (m.sheenRoughnessTexture ? at.texture(m.sheenRoughnessTexture).a : 1.0f);
  }
  static bool present(const Parameters& p) { return maxComponent(p.sheenColor) > 0; }

  void init(const Parameters& p) {
    color_ = p.sheenColor;
    largest_ = maxComponent(p.sheenColor);
    charlie_ = Charlie(p.sheenRoughness);
    row_ = sheenTableRow(p.sheenRoughness);
  }
  void setDirection(const Vec3& wo) {
    albedoO_ = sheenAlbedo(row_, wo.z);
    belowO_ = belowAt(albedoO_);
  }

  Spectrum albedo(const Spectrum& above) const { return above * color_ * ((1 - belowO_) / largest_); }
  float below() const { return belowO_; }
  float below(const Vec3& wi) const { return belowAt(sheenAlbedo(row_, std::fabs(wi.z))); }
  // Where sheen would reflect more than it receives it is scaled down, for the larger of the two directions' albedos:
  // the result is reciprocal and reflects at most 1.
  void add(const Vec3& wo, const Vec3& wi, float probability, BsdfValue& v) const {
    const float excess = std::max({1.0f, albedoO_, sheenAlbedo(row_, wi.z)});
    v.f += color_ * (charlie_.evaluate(wo, wi) / excess);
    v.pdfW += probability * kInvTwoPi;
  }
  bool sample(const Vec3&, const Vec2& u, float, BsdfSample& out) const {
    out.wi = squareToUniformHemisphere(u);
    return true;
  }

 private:
  float belowAt(float albedo) const { return 1 - largest_ * std::min(albedo, 1.0f); }

  Spectrum color_;
  float largest_, albedoO_, belowO_;
  Charlie charlie_;
  TableRow row_;
};

}  // namespace braid
