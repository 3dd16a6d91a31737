// SPDX-License-Identifier: Apache-2.0
// How much light the specular layer, sheen and clearcoat leave to what lies below them, and the two covering lobes.
#include <algorithm>
#include <cmath>

#include "renderer/transport/bsdf/bsdf.h"

namespace braid {

constexpr float kClearcoatF0 = 0.04f;  // index 1.5 (KHR_materials_clearcoat)

void Bsdf::initSheen(const SurfaceParameters& p) {
  sheenColor_ = p.sheenColor;
  sheenMax_ = maxComponent(p.sheenColor);
  charlie_ = Charlie(p.sheenRoughness);
  sheenRow_ = sheenTableRow(p.sheenRoughness);
}

void Bsdf::initClearcoat(const SurfaceParameters& p) {
  clearcoat_ = p.clearcoat;
  clearcoatNormal_ = p.clearcoatNormal;
  const float alpha = sqr(p.clearcoatRoughness);
  clearcoatSmooth_ = alpha < Ggx::kMinAlpha;
  clearcoatGgx_.alphaX = clearcoatGgx_.alphaY = alpha;
  clearcoatRow_ = ggxTableRow(clearcoatSmooth_ ? 0.0f : alpha);
}

// Albedo curves of the dielectric layer, for Fresnel terms that are no Schlick curves, and the means of the albedo.
void Bsdf::initMeanAlbedo() {
  if (!general_) {
    const float along = dielectricAlbedo(ggxMeanAlbedo(row_)), across = dielectricAlbedo(ggxMeanAlbedo(rowAcross_));
    meanAlbedo_[0] = meanAlbedo_[1] = std::max(along, across);
    return;
  }
  for (size_t side = 0; side < 2; ++side) {
    Bsdf view = *this;
    if (side == 1) {
      view.entering_ = !entering_;
      view.eta_ = 1 / eta_;
    }
    float above = 1;
    for (int k = 0; k < kFresnelNodes; ++k) {
      const float value = 1 - view.fresnelGeneral(static_cast<float>(k) / (kFresnelNodes - 1)).base;
      // TRAP: total reflection ends in a step, which linear interpolation would undercut by half a cell; the value of
      // the node before is an upper bound, as this curve falls monotonically.
      curve_[side][static_cast<size_t>(k)] = view.refractive_ && view.eta_ < 1 ? std::max(above, value) : value;
      above = value;
    }
    meanAlbedo_[side] =
        std::max(ggxMeanAlbedo(row_, curve_[side].data()), ggxMeanAlbedo(rowAcross_, curve_[side].data()));
    if (!refractive_) {  // both sides look alike
      curve_[1] = curve_[0];
      meanAlbedo_[1] = meanAlbedo_[0];
      return;
    }
  }
}

// Anisotropic layers take the larger albedo of their two axes: an upper bound that does not depend on azimuth.
float Bsdf::dielectricAlbedo(int side, float cosine) const {
  const auto along = [&](const TableRow& row) {
    if (general_) return ggxAlbedo(row, cosine, curve_[static_cast<size_t>(side)].data());
    return dielectricAlbedo(ggxAlbedo(row, cosine));
  };
  const float e = has(kLobeAnisotropy) ? std::max(along(row_), along(rowAcross_)) : along(row_);
  return std::min(e, 1.0f);
}

// Kulla & Conty 2017, "Revisiting Physically Based Shading at Imageworks": reciprocal, and a white diffuse base returns
// exactly what the layer lets through.
float Bsdf::diffuseBelowSpecular(const Vec3& wi) const {
  if (!weighsDiffuse_) return 1;
  const int side = wi.z > 0 ? 0 : 1;
  const float below = belowSpecularO_ * (1 - dielectricAlbedo(side, std::fabs(wi.z)));
  // Light that crosses sees the layer from both sides; the larger of the two norms conserves energy both ways.
  const float norm = 1 - (side == 0 ? meanAlbedo_[0] : std::min(meanAlbedo_[0], meanAlbedo_[1]));
  // The floor bounds the ratio under layers that reflect nearly everything; it only ever loses light.
  return below / std::max(norm, 0.05f);
}

// What the layers leave below them of light from one direction, given the sheen's albedo there and the cosine to the
// coat's normal.
float Bsdf::belowSheen(float albedo) const { return 1 - sheenMax_ * std::min(albedo, 1.0f); }

float Bsdf::belowClearcoat(float cosine) const {
  const GgxAlbedo e = ggxAlbedo(clearcoatRow_, cosine);
  return 1 - clearcoat_ * (kClearcoatF0 * e.f0 + e.f90);
}

// What a layer leaves of the light from wi that the base scatters to wo: KHR_materials_sheen's minimum, reciprocal and
// never more than the light that was not reflected. Only sides that carry the layer count.
float Bsdf::belowSheen(const Vec3& wi) const {
  const bool coatedI = wi.z > 0 ? coatedHere_ : coatedThere_;
  return std::min(coatedHere_ ? sheenBelowO_ : 1.0f,
                  coatedI ? belowSheen(sheenAlbedo(sheenRow_, std::fabs(wi.z))) : 1.0f);
}

float Bsdf::belowClearcoat(const Vec3& wi) const {
  const bool coatedI = wi.z > 0 ? coatedHere_ : coatedThere_;
  const float cosine = glm::dot(clearcoatNormal_, wi);
  return std::min(coatedHere_ ? clearcoatBelowO_ : 1.0f,
                  coatedI ? belowClearcoat(std::max(wi.z > 0 ? cosine : -cosine, 1e-4f)) : 1.0f);
}

float Bsdf::belowLayers(const Vec3& wi) const {
  float share = 1;
  if (has(kLobeSheen)) share *= belowSheen(wi);
  if (has(kLobeClearcoat)) share *= belowClearcoat(wi);
  return share;
}

// Covers f, the base's value, with sheen and then clearcoat.
void Bsdf::addLayers(const Vec3& wi, BsdfValue& v) const {
  const bool reflects = wi.z > 0 && coatedHere_;
  if (has(kLobeSheen)) {
    v.f *= belowSheen(wi);
    if (reflects && scatters(kLobeSheen)) addSheen(wi, v);
  }
  if (has(kLobeClearcoat)) {
    v.f *= belowClearcoat(wi);
    if (reflects && !clearcoatSmooth_ && scatters(kLobeClearcoat)) addClearcoat(wi, v);
  }
}

// Where sheen would reflect more than it receives it is scaled down, for the larger of the two directions' albedos: the
// result is reciprocal and reflects at most 1.
void Bsdf::addSheen(const Vec3& wi, BsdfValue& v) const {
  const float excess = std::max({1.0f, sheenAlbedoO_, sheenAlbedo(sheenRow_, wi.z)});
  v.f += sheenColor_ * (charlie_.evaluate(wo_, wi) / excess);
  v.pdfW += select_.sheen * kInvTwoPi;
}

// GGX about the coat's own normal. The cosine is that to the coat's normal too, as in the reference viewer; the lobe
// then reflects no more than it receives.
void Bsdf::addClearcoat(const Vec3& wi, BsdfValue& v) const {
  const float cosI = glm::dot(clearcoatNormal_, wi);
  if (!(cosI > 0)) return;
  const Frame frame(clearcoatNormal_);
  const Vec3 o = clearcoatDirection(frame), i = frame.toLocal(wi);
  const Vec3 h = glm::normalize(o + i);
  const float d = clearcoatGgx_.D(h), stretchO = clearcoatGgx_.stretch(o);
  const float fr = kClearcoatF0 + (1 - kClearcoatF0) * schlickWeight(glm::dot(o, h));
  v.f += Spectrum(clearcoat_ * fr * d * cosI * Ggx::visibility(o.z, stretchO, cosI, clearcoatGgx_.stretch(i)));
  v.pdfW += select_.clearcoat * 0.25f * Ggx::visibleNormals(d, o.z, stretchO);
}

// wo about the coat's normal, lifted to its horizon.
Vec3 Bsdf::clearcoatDirection(const Frame& frame) const {
  const Vec3 o = frame.toLocal(wo_);
  return o.z >= clearcoatCosO_ ? o : glm::normalize(Vec3(o.x, o.y, clearcoatCosO_));
}

bool Bsdf::sampleClearcoat(const Vec2& u, BsdfSample& out) const {
  const Frame frame(clearcoatNormal_);
  const Vec3 o = clearcoatDirection(frame);
  Vec3 i(-o.x, -o.y, o.z);
  if (!clearcoatSmooth_) {
    const Vec3 h = clearcoatGgx_.sampleVisibleNormal(o, clearcoatGgx_.stretch(o), u);
    i = 2 * glm::dot(o, h) * h - o;
  }
  out.wi = glm::normalize(frame.toWorld(i));
  if (!(i.z > 0 && out.wi.z > 0)) return false;
  if (clearcoatSmooth_) {
    const float fr = kClearcoatF0 + (1 - kClearcoatF0) * schlickWeight(o.z);
    out.delta = true;
    out.pdfW = select_.clearcoat;
    out.weight = Spectrum(clearcoat_ * fr / out.pdfW);
  }
  return true;
}

}  // namespace braid
