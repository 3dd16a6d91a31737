// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/bsdf/clearcoat.h"

#include <cmath>

#include "renderer/transport/bsdf/fresnel.h"

namespace braid {

namespace {

constexpr float kF0 = 0.04f;  // index 1.5 (KHR_materials_clearcoat)

}  // namespace

void Clearcoat::init(const Parameters& p) {
  amount_ = p.clearcoat;
  normal_ = p.clearcoatNormal;
  const float alpha = sqr(p.clearcoatRoughness);
  smooth_ = alpha < Ggx::kMinAlpha;
  ggx_.alphaX = ggx_.alphaY = alpha;
  row_ = ggxTableRow(smooth_ ? 0.0f : alpha);
}

// The cosine is that to the coat's normal.
float Clearcoat::belowAt(float cosine) const {
  const GgxAlbedo e = ggxAlbedo(row_, cosine);
  return 1 - amount_ * (kF0 * e.f0 + e.f90);
}

// GGX about the coat's own normal. The cosine is that to the coat's normal too, as in the reference viewer; the lobe
// then reflects no more than it receives.
void Clearcoat::add(const Vec3& wo, const Vec3& wi, float probability, BsdfValue& v) const {
  const float cosI = glm::dot(normal_, wi);
  if (!(cosI > 0)) return;
  const Frame frame(normal_);
  const Vec3 o = toCoat(frame, wo), i = frame.toLocal(wi);
  const Vec3 h = glm::normalize(o + i);
  const float d = ggx_.D(h), stretchO = ggx_.stretch(o);
  const float fr = kF0 + (1 - kF0) * schlickWeight(glm::dot(o, h));
  v.f += Spectrum(amount_ * fr * d * cosI * Ggx::visibility(o.z, stretchO, cosI, ggx_.stretch(i)));
  v.pdfW += probability * 0.25f * Ggx::visibleNormals(d, o.z, stretchO);
}

// wo about the coat's normal, lifted to its horizon.
Vec3 Clearcoat::toCoat(const Frame& frame, const Vec3& wo) const {
  const Vec3 o = frame.toLocal(wo);
  return o.z >= cosO_ ? o : glm::normalize(Vec3(o.x, o.y, cosO_));
}

bool Clearcoat::sample(const Vec3& wo, const Vec2& u, float probability, BsdfSample& out) const {
  const Frame frame(normal_);
  const Vec3 o = toCoat(frame, wo);
  Vec3 i(-o.x, -o.y, o.z);
  if (!smooth_) {
    const Vec3 h = ggx_.sampleVisibleNormal(o, ggx_.stretch(o), u);
    i = 2 * glm::dot(o, h) * h - o;
  }
  out.wi = glm::normalize(frame.toWorld(i));
  if (!(i.z > 0 && out.wi.z > 0)) return false;
  if (smooth_) {
    const float fr = kF0 + (1 - kF0) * schlickWeight(o.z);
    out.delta = true;
    out.pdfW = probability;
    out.weight = Spectrum(amount_ * fr / out.pdfW);
  }
  return true;
}

}  // namespace braid
