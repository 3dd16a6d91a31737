// SPDX-License-Identifier: Apache-2.0
// Set-up of the lobes, the choice among them, and the public operations. The lobes: lobes_specular.cpp,
// lobes_layers.cpp; groups of them: lobe_groups.cpp.
#include "renderer/transport/bsdf/bsdf.h"

#include <algorithm>
#include <cmath>

namespace braid {
namespace {

bool anyPositive(const Spectrum& s) { return s.x > 0 || s.y > 0 || s.z > 0; }

// A rough refraction bends by about |eta - 1| times the slope of the microfacets. Below this it is a mirror's: float
// half vectors, which are differences of nearly opposite directions then, carry no more information.
constexpr float kMinBending = 1e-4f;

}  // namespace

void Bsdf::initLayers(const SurfaceParameters& p, Transport transport) {
  lobes_ = p.lobes;
  entering_ = p.entering;
  const bool metallicWorkflow = has(kLobeSpecular) && !has(kLobeSpecularGlossiness);
  metallic_ = metallicWorkflow ? p.metallic : 0.0f;
  const float transmission = has(kLobeTransmission) ? p.transmission : 0.0f;
  const float through = has(kLobeDiffuseTransmission) ? p.diffuseTransmission : 0.0f;
  const float share = (1 - metallic_) * (1 - transmission);
  Spectrum diffuseColor = p.baseColor;
  if (has(kLobeSpecularGlossiness)) diffuseColor *= std::max(1 - maxComponent(p.specularF0), 0.0f);
  diffuse_ = has(kLobeDiffuse) ? diffuseColor * (share * (1 - through)) : Spectrum(0);
  diffuseTransmission_ = has(kLobeDiffuseTransmission) ? p.diffuseTransmissionColor * (share * through) : Spectrum(0);
  transmission_ = p.baseColor * ((1 - metallic_) * transmission);

  const auto keep = [&](uint32_t lobe, bool condition) {
    if (!condition) lobes_ &= ~lobe;
  };
  keep(kLobeDiffuse, anyPositive(diffuse_));
  keep(kLobeDiffuseTransmission, anyPositive(diffuseTransmission_));
  keep(kLobeTransmission, anyPositive(transmission_));
  keep(kLobeClearcoat, has(kLobeClearcoat) && p.clearcoat > 0);
  keep(kLobeSheen, has(kLobeSheen) && anyPositive(p.sheenColor));
  keep(kLobeIridescence, has(kLobeIridescence) && p.iridescence > 0);

  if (has(kLobeSpecular | kLobeTransmission)) initSpecular(p);
  straight_ = has(kLobeTransmission) && p.thinWalled && smooth_;
  radianceScale_ = has(kLobeTransmission) ? 1 / sqr(eta_) : 1.0f;
  transmissionScale_ = transport == Transport::Radiance ? 1.0f : sqr(eta_);

  // A coat covers the outside; a thin wall has two outsides.
  coatedHere_ = p.thinWalled || p.entering;
  coatedThere_ = p.thinWalled || !p.entering;
  if (has(kLobeSheen)) initSheen(p);
  if (has(kLobeClearcoat)) initClearcoat(p);
  initBelowSpecular();

  // What remains may be a plain diffuse surface, for instance with specular 0.
  diffuseOnly_ = lobes_ == kLobeDiffuse;
  scatter_ = lobes_;
  group_ = LobeGroup::All;
  if (!diffuseOnly_) initDirection();
}

void Bsdf::initSpecular(const SurfaceParameters& p) {
  const float indexF0 = fresnelF0(p.etaInside, p.etaOutside);
  weight_ = !has(kLobeSpecular) ? 0.0f : has(kLobeSpecularGlossiness) ? 1.0f : p.specular;
  dielectricF0_ = has(kLobeSpecularGlossiness) ? p.specularF0
                  : has(kLobeSpecular)         ? glm::min(indexF0 * p.specularColor, Spectrum(1))
                                               : Spectrum(0);
  metalF0_ = p.baseColor;
  f0_ = glm::mix(dielectricF0_ * weight_, metalF0_, metallic_);
  f90_ = glm::mix(weight_, 1.0f, metallic_);
  baseF0_ = weight_ * maxComponent(dielectricF0_);
  baseF90_ = weight_;

  // TRAP: index 0 is the specular-glossiness idiom and refracts nowhere; such a wall blurs like a thin one.
  refractive_ = has(kLobeTransmission) && !p.thinWalled && p.etaInside > 0 && p.etaOutside > 0;
  eta_ = !refractive_ ? 1.0f : p.entering ? p.etaInside / p.etaOutside : p.etaOutside / p.etaInside;
  if (has(kLobeIridescence)) {
    iridescence_ = p.iridescence;
    film_ = {p.etaOutside > 0 ? p.etaOutside : 1.0f, std::max(p.iridescenceIor, 1.0f), p.iridescenceThickness};
  }
  general_ = refractive_ || has(kLobeIridescence);
  // Without any specular reflection only total reflection inside a solid needs the lobe.
  if (f90_ == 0 && !anyPositive(f0_) && !refractive_ && !has(kLobeIridescence)) lobes_ &= ~uint32_t{kLobeSpecular};
  initDistribution(p);
}

void Bsdf::initDistribution(const SurfaceParameters& p) {
  const float alpha = sqr(p.roughness);
  ggx_.alphaX = ggx_.alphaY = alpha;
  if (has(kLobeAnisotropy) && p.anisotropy != 0) {
    ggx_.alphaX = glm::mix(alpha, 1.0f, sqr(p.anisotropy));
    tangent_ = p.anisotropyDirection;
  } else {
    lobes_ &= ~uint32_t{kLobeAnisotropy};
  }
  smooth_ = std::max(ggx_.alphaX, ggx_.alphaY) < Ggx::kMinAlpha;
  if (smooth_) {
    ggx_.alphaX = ggx_.alphaY = 0;
    lobes_ &= ~uint32_t{kLobeAnisotropy};
  } else {
    ggx_.alphaX = std::max(ggx_.alphaX, Ggx::kMinAlpha);
    ggx_.alphaY = std::max(ggx_.alphaY, Ggx::kMinAlpha);
  }
  const float bending = std::fabs(eta_ - 1) * std::min(ggx_.alphaX, ggx_.alphaY);
  passThrough_ = has(kLobeTransmission) && refractive_ && !smooth_ && bending < kMinBending;
}

void Bsdf::initBelowSpecular() {
  const bool specular = has(kLobeSpecular | kLobeTransmission);
  if (!specular) smooth_ = passThrough_ = general_ = refractive_ = false;
  constexpr uint32_t kOthers = kLobeDiffuse | kLobeDiffuseTransmission | kLobeSheen | kLobeClearcoat;
  microfacetOnly_ = !has(kOthers) && !passThrough_;
  weighsDiffuse_ = specular && (has(kLobeDiffuse | kLobeDiffuseTransmission) || passThrough_);
  nonDelta_ = has(kLobeDiffuse | kLobeDiffuseTransmission) || (specular && !smooth_) ||
              (has(kLobeSheen) && coatedHere_) || (has(kLobeClearcoat) && coatedHere_ && !clearcoatSmooth_);
  if (!weighsDiffuse_) return;
  row_ = ggxTableRow(ggx_.alphaX);
  rowAcross_ = has(kLobeAnisotropy) ? ggxTableRow(ggx_.alphaY) : row_;
  initMeanAlbedo();
}

void Bsdf::initDirection() {
  if (has(kLobeSpecular | kLobeTransmission)) stretchO_ = ggx_.stretch(toGgx(wo_));
  if (weighsDiffuse_) {
    albedoO_ = ggxAlbedo(row_, wo_.z);
    const bool plain = !general_ && !has(kLobeAnisotropy);
    belowSpecularO_ = 1 - (plain ? dielectricAlbedo(albedoO_) : dielectricAlbedo(0, wo_.z));
  }
  if (has(kLobeSheen) && coatedHere_) {
    sheenAlbedoO_ = sheenAlbedo(sheenRow_, wo_.z);
    sheenBelowO_ = belowSheen(sheenAlbedoO_);
  }
  if (has(kLobeClearcoat) && coatedHere_) {
    // As for the shading normal: directions below the coat's horizon are lifted to it.
    clearcoatCosO_ = std::max(glm::dot(clearcoatNormal_, wo_), 1e-4f);
    clearcoatBelowO_ = belowClearcoat(clearcoatCosO_);
  }
  select_ = select();
}

Bsdf Bsdf::reversed(const Vec3& wi) const {
  Bsdf b = *this;
  b.wo_ = aboveHorizon(wi);
  if (wi.z < 0) {
    b.entering_ = !entering_;
    if (has(kLobeSpecular | kLobeTransmission)) b.eta_ = 1 / eta_;
    std::swap(b.coatedHere_, b.coatedThere_);
    if (weighsDiffuse_) {
      std::swap(b.curve_[0], b.curve_[1]);
      std::swap(b.meanAlbedo_[0], b.meanAlbedo_[1]);
    }
    // The other side's frame has the same x and y and the opposite z; the coat's normal points to that side there.
    if (has(kLobeClearcoat)) b.clearcoatNormal_ = Vec3(-clearcoatNormal_.x, -clearcoatNormal_.y, clearcoatNormal_.z);
  }
  b.initDirection();
  return b;
}

// smooth: ignore what roughness does to the albedo.
Bsdf::LobeAlbedos Bsdf::lobeAlbedos(bool smooth) const {
  LobeAlbedos a;
  const float below = weighsDiffuse_ ? belowSpecularO_ : 1.0f;
  a.diffuse = diffuse_ * below;
  a.diffuseTransmission = diffuseTransmission_ * below;
  if (has(kLobeSpecular | kLobeTransmission)) {
    const FresnelTerm f = fresnel(wo_.z);
    a.reflection = f.reflect;
    if (!smooth && !smooth_ && weighsDiffuse_) {
      a.reflection = general_ ? f.reflect * (albedoO_.f0 + albedoO_.f90) : f0_ * albedoO_.f0 + f90_ * albedoO_.f90;
    }
    a.transmission = transmission_ * f.base;
  }
  Spectrum cover(1);
  if (has(kLobeClearcoat) && coatedHere_) {
    a.clearcoat = Spectrum(1 - clearcoatBelowO_);
    cover *= clearcoatBelowO_;
  }
  if (has(kLobeSheen) && coatedHere_) {
    a.sheen = cover * sheenColor_ * ((1 - sheenBelowO_) / sheenMax_);
    cover *= sheenBelowO_;
  }
  a.diffuse *= cover;
  a.diffuseTransmission *= cover;
  a.reflection *= cover;
  a.transmission *= cover;
  return a;
}

Bsdf::Selection Bsdf::select() const {
  Selection s{};
  if (has(kLobeSpecular | kLobeTransmission) && microfacetOnly_) {
    s.specular = 1;
    return group_ == LobeGroup::All ? s : restrictedTo(group_, s);
  }
  const LobeAlbedos a = lobeAlbedos(false);
  s.diffuse = average(a.diffuse);
  s.diffuseTransmission = average(a.diffuseTransmission);
  s.specular = average(a.reflection);
  (passThrough_ ? s.passThrough : s.specular) += average(a.transmission);
  s.sheen = average(a.sheen);
  s.clearcoat = average(a.clearcoat);

  float* const all[] = {&s.diffuse, &s.diffuseTransmission, &s.specular, &s.passThrough, &s.sheen, &s.clearcoat};
  float total = 0, count = 0;
  for (const float* w : all) {
    total += *w;
    count += *w > 0 ? 1.0f : 0.0f;
  }
  if (!(total > 0)) return Selection{};
  // The albedos are estimates: every lobe keeps a share, which bounds the weight of what an estimate missed.
  constexpr float kFloor = 0.05f;
  const float scale = 1 / (total * (1 + kFloor * count));
  for (float* w : all) *w = *w > 0 ? (*w + kFloor * total) * scale : 0.0f;
  return group_ == LobeGroup::All ? s : restrictedTo(group_, s);
}

Spectrum Bsdf::layersAlbedo() const {
  const LobeAlbedos a = lobeAlbedos(true);
  const Spectrum sum = a.diffuse + a.diffuseTransmission + a.reflection + a.transmission + a.sheen + a.clearcoat;
  return glm::clamp(sum, Spectrum(0), Spectrum(1));
}

BsdfValue Bsdf::evaluateLayers(const Vec3& wi, bool reverse) const {
  BsdfValue v;
  if (!nonDelta_ || wi.z == 0) return v;
  if (wi.z > 0) {
    if (scatters(kLobeDiffuse)) {
      const float cosine = wi.z * kInvPi;
      v.f = diffuse_ * (cosine * diffuseBelowSpecular(wi));
      v.pdfW = select_.diffuse * cosine;
    }
    if (scatters(kLobeSpecular | kLobeTransmission) && !smooth_) addReflection(wi, v);
  } else {
    if (scatters(kLobeDiffuseTransmission)) {
      const float cosine = -wi.z * kInvPi;
      v.f = diffuseTransmission_ * (cosine * diffuseBelowSpecular(wi));
      v.pdfW = select_.diffuseTransmission * cosine;
    }
    if (scatters(kLobeTransmission) && !smooth_ && !passThrough_) addTransmission(wi, v);
  }
  if (has(kLobeSheen | kLobeClearcoat)) addLayers(wi, v);
  if (reverse) {
    const Vec3 back = wi.z > 0 ? wo_ : Vec3(wo_.x, wo_.y, -wo_.z);
    v.pdfRevW = reversed(wi).evaluateLayers(back, false).pdfW;
  }
  return v;
}

bool Bsdf::sampleLayers(float uLobe, const Vec2& u, BsdfSample& out) const {
  out.delta = out.transmitted = out.straight = false;
  BsdfValue v;
  if (!sampleDirection(uLobe, u, out, v)) return false;
  if (out.delta) return out.pdfW > 0;
  if (!microfacetOnly_) v = evaluateLayers(out.wi, false);
  if (!(v.pdfW > 0)) return false;
  out.pdfW = v.pdfW;
  out.weight = v.f / v.pdfW;
  out.transmitted = out.wi.z < 0;
  return true;
}

// Picks a lobe and a direction from it. Delta lobes fill in everything, microfacets on their own v, the others wi
// alone.
bool Bsdf::sampleDirection(float uLobe, const Vec2& u, BsdfSample& out, BsdfValue& v) const {
  const auto take = [&uLobe](float probability) {
    if (uLobe < probability) {
      uLobe = std::min(uLobe / probability, kOneMinusEpsilon);
      return true;
    }
    uLobe -= probability;
    return false;
  };
  if (take(select_.specular)) return smooth_ ? sampleMirror(uLobe, out) : sampleMicrofacet(uLobe, u, out, v);
  if (take(select_.clearcoat)) return sampleClearcoat(u, out);
  if (take(select_.passThrough)) return samplePassThrough(out);
  if (take(select_.diffuse)) {
    out.wi = squareToCosineHemisphere(u);
    return true;
  }
  if (take(select_.diffuseTransmission)) {
    const Vec3 w = squareToCosineHemisphere(u);
    out.wi = Vec3(w.x, w.y, -w.z);
    return true;
  }
  if (take(select_.sheen)) {
    out.wi = squareToUniformHemisphere(u);
    return true;
  }
  return false;
}

}  // namespace braid
