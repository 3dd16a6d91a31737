// SPDX-License-Identifier: Apache-2.0
// A clear layer with a normal of its own over everything else (KHR_materials_clearcoat): GGX, or a mirror.
#pragma once

#include <algorithm>

#include "renderer/transport/bsdf/albedo_tables.h"
#include "renderer/transport/bsdf/cover.h"
#include "renderer/transport/bsdf/microfacet.h"
#include "renderer/scene/data/lobes.h"

namespace braid {

struct ClearcoatParameters {
  float clearcoat = 0;
  float clearcoatRoughness = 0;
  Vec3 clearcoatNormal{0, 0, 1};  // in the local shading frame
};

class Clearcoat : public CoverLobe {
 public:
  using Parameters = ClearcoatParameters;
  static constexpr uint32_t kLobe = kLobeClearcoat;
  static constexpr bool kAlwaysBroad = false;

  template <class Point>
  static void read(const Point& at, Parameters& p) {
    const Material& m = at.material();
    p.clearcoat = m.clearcoat * (m.clearcoatTexture ? at.texture(m.clearcoatTexture).r : 1.0f);
    p.clearcoatRoughness =
        m.clearcoatRoughness * (m.clearcoatRoughnessTexture ? at.texture(m.clearcoatRoughnessTexture).g : 1.0f);
    p.clearcoatNormal = at.coatNormal();
  }
  static bool present(const Parameters& p) { return p.clearcoat > 0; }

  void init(const Parameters& p);
  void setDirection(const Vec3& wo) {
    // As for the shading normal: directions below the coat's horizon are lifted to it.
    cosO_ = std::max(glm::dot(normal_, wo), 1e-4f);
    belowO_ = belowAt(cosO_);
  }
  // The other side's frame has the same x and y and the opposite z; the coat's normal points to that side there.
  void turn() { normal_ = Vec3(-normal_.x, -normal_.y, normal_.z); }
  bool smooth() const { return smooth_; }
  bool broad() const { return !smooth_ && ggx_.alphaX >= kBroadAlpha; }

  Spectrum albedo(const Spectrum& above) const { return above * (1 - belowO_); }
  float below() const { return belowO_; }
  float below(const Vec3& wi) const {
    const float cosine = glm::dot(normal_, wi);
    return belowAt(std::max(wi.z > 0 ? cosine : -cosine, 1e-4f));
  }
  void add(const Vec3& wo, const Vec3& wi, float probability, BsdfValue& v) const;
  bool sample(const Vec3& wo, const Vec2& u, float probability, BsdfSample& out) const;

 private:
  float belowAt(float cosine) const;
  Vec3 toCoat(const Frame& frame, const Vec3& wo) const;

  float amount_, cosO_, belowO_;
  Ggx ggx_;
  bool smooth_;
  Vec3 normal_;
  TableRow row_;
};

}  // namespace braid
