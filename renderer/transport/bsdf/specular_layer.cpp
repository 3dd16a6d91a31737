// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/bsdf/specular_layer.h"

#include <cmath>

namespace braid {

namespace {

// A rough refraction bends by about |eta - 1| times the slope of the microfacets. Below this it is a mirror's: float
// half vectors, which are differences of nearly opposite directions then, carry no more information.
constexpr float kMinBending = 1e-4f;

}  // namespace

uint32_t SpecularLayer::init(const SurfaceParameters& p, uint32_t lobes, Transport transport) {
  lobes_ = lobes;
  entering_ = p.entering;
  metallic_ = p.metalShare();
  transmission_ = p.baseColor * ((1 - metallic_) * p.transmissionShare());
  if (!anyPositive(transmission_)) lobes_ &= ~uint32_t{kLobeTransmission};
  if (has(kLobeIridescence) && !(p.iridescence > 0)) lobes_ &= ~uint32_t{kLobeIridescence};
  if (present()) {
    initFresnel(p);
    initDistribution(p);
  }
  straight_ = has(kLobeTransmission) && p.thinWalled && smooth_;
  radianceScale_ = has(kLobeTransmission) ? 1 / sqr(eta_) : 1.0f;
  transmissionScale_ = transport == Transport::Radiance || !has(kLobeTransmission) ? 1.0f : sqr(eta_);
  if (!present()) smooth_ = passThrough_ = general_ = refractive_ = false;
  weighsDiffuse_ = present() && (has(kLobeDiffuse | kLobeDiffuseTransmission) || passThrough_);
  initMultiScatter(p, transport);
  if (weighsDiffuse_) {
    row_ = ggxTableRow(ggx_.alphaX);
    rowAcross_ = has(kLobeAnisotropy) ? ggxTableRow(ggx_.alphaY) : row_;
    initMeanAlbedo();
  }
  return lobes_;
}

void SpecularLayer::initFresnel(const SurfaceParameters& p) {
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
}

void SpecularLayer::initDistribution(const SurfaceParameters& p) {
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

void SpecularLayer::setDirection(const Vec3& wo) {
  wo_ = wo;
  stretchO_ = ggx_.stretch(toGgx(wo_));
  if (has(kLobeMultiScatter)) {
    if (metallic_ > 0) metalO_ = metalFactor(wo_.z);
    if (transmissionShare_ > 0) glassO_ = 1 / glassAlbedo(glass_, wo_.z);
  }
  if (!weighsDiffuse_) return;
  albedoO_ = ggxAlbedo(row_, wo_.z);
  const bool plain = !general_ && !has(kLobeAnisotropy);
  belowO_ = 1 - (plain ? dielectricAlbedo(albedoO_) : dielectricAlbedo(0, wo_.z));
}

void SpecularLayer::turn() {
  entering_ = !entering_;
  eta_ = 1 / eta_;
  if (has(kLobeMultiScatter) && transmissionShare_ > 0) glass_ = glass_.otherSide();
  if (!weighsDiffuse_) return;
  std::swap(curve_[0], curve_[1]);
  std::swap(meanAlbedo_[0], meanAlbedo_[1]);
}

SpecularLayer::Albedos SpecularLayer::albedos(bool exact) const {
  const Fresnel f = fresnel(wo_.z);
  Albedos a{f.reflect, transmission_ * f.base};
  if (exact && !smooth_ && weighsDiffuse_) {
    a.reflection = general_ ? f.reflect * (albedoO_.f0 + albedoO_.f90) : f0_ * albedoO_.f0 + f90_ * albedoO_.f90;
  }
  return a;
}

// Albedo curves of the dielectric layer, for Fresnel terms that are no Schlick curves, and the means of the albedo.
void SpecularLayer::initMeanAlbedo() {
  if (!general_) {
    const float along = dielectricAlbedo(ggxMeanAlbedo(row_)), across = dielectricAlbedo(ggxMeanAlbedo(rowAcross_));
    meanAlbedo_[0] = meanAlbedo_[1] = std::max(along, across);
    return;
  }
  for (size_t side = 0; side < 2; ++side) {
    SpecularLayer view = *this;
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
float SpecularLayer::dielectricAlbedo(int side, float cosine) const {
  const auto along = [&](const TableRow& row) {
    if (general_) return ggxAlbedo(row, cosine, curve_[static_cast<size_t>(side)].data());
    return dielectricAlbedo(ggxAlbedo(row, cosine));
  };
  const float e = has(kLobeAnisotropy) ? std::max(along(row_), along(rowAcross_)) : along(row_);
  return std::min(e, 1.0f);
}

// Kulla & Conty 2017, "Revisiting Physically Based Shading at Imageworks": reciprocal, and a white diffuse base returns
// exactly what the layer lets through.
float SpecularLayer::belowToward(const Vec3& wi) const {
  if (!weighsDiffuse_) return 1;
  const int side = wi.z > 0 ? 0 : 1;
  const float below = belowO_ * (1 - dielectricAlbedo(side, std::fabs(wi.z)));
  // Light that crosses sees the layer from both sides; the larger of the two norms conserves energy both ways.
  const float norm = 1 - (side == 0 ? meanAlbedo_[0] : std::min(meanAlbedo_[0], meanAlbedo_[1]));
  // The floor bounds the ratio under layers that reflect nearly everything; it only ever loses light.
  return below / std::max(norm, 0.05f);
}

// VdotH in, reflectance and what it leaves out. Schlick for opaque and thin surfaces (glTF 2.0 appendix B.3.4).
SpecularLayer::Fresnel SpecularLayer::fresnel(float cosine) const {
  if (general_) return fresnelGeneral(cosine);
  const float s = schlickWeight(cosine);
  return {f0_ + (f90_ - f0_) * s, 1 - (baseF0_ + (baseF90_ - baseF0_) * s)};
}

// The exact dielectric on a solid that lets light through, and thin films. Both are functions of the angle outside, so
// that light leaving along a path meets the reflectance it met entering.
SpecularLayer::Fresnel SpecularLayer::fresnelGeneral(float cosine) const {
  float outer = std::min(cosine, 1.0f), s;
  if (refractive_) {
    const float cosT = refractedCosine(outer, eta_);
    // Total reflection is complete whatever specular and specularColor say: there is no direction to refract to.
    if (cosT < 0) return {glm::mix(Spectrum(1), metalF0_, metallic_), 0.0f};
    // Schlick's weight taken from the exact curve: F0 and F90 then stay where KHR_materials_specular puts them.
    const float exactF0 = fresnelF0(1, eta_);
    s = glm::clamp((fresnelDielectric(outer, eta_) - exactF0) / (1 - exactF0), 0.0f, 1.0f);
    if (!entering_) outer = cosT;
  } else {
    s = schlickWeight(outer);
  }
  Spectrum dielectric = weight_ * (dielectricF0_ + (1.0f - dielectricF0_) * s);
  Spectrum metal = metalF0_ + (1.0f - metalF0_) * schlickWeight(outer);
  if (has(kLobeIridescence)) {
    if (metallic_ < 1) {
      dielectric = glm::mix(dielectric, fresnelThinFilm(film_, weight_ * dielectricF0_, outer), iridescence_);
    }
    if (metallic_ > 0) metal = glm::mix(metal, fresnelThinFilm(film_, metalF0_, outer), iridescence_);
  }
  return {glm::mix(dielectric, metal, metallic_), std::max(1 - maxComponent(dielectric), 0.0f)};
}

// Given a microfacet: the probability of reflecting rather than transmitting.
float SpecularLayer::reflectProbability(const Fresnel& f) const {
  if (!has(kLobeTransmission) || passThrough_) return 1;
  const float r = average(f.reflect), t = average(transmission_) * f.base;
  return r + t > 0 ? r / (r + t) : 0.0f;
}

Vec3 SpecularLayer::toGgx(const Vec3& w) const {
  if (!has(kLobeAnisotropy)) return w;
  return Vec3(w.x * tangent_.x + w.y * tangent_.y, w.y * tangent_.x - w.x * tangent_.y, w.z);
}

Vec3 SpecularLayer::fromGgx(const Vec3& w) const {
  if (!has(kLobeAnisotropy)) return w;
  return Vec3(w.x * tangent_.x - w.y * tangent_.y, w.y * tangent_.x + w.x * tangent_.y, w.z);
}

void SpecularLayer::addReflection(const Vec3& wi, float probability, BsdfValue& v) const {
  Facet facet{toGgx(wo_), toGgx(wi), Vec3(0), {}};
  facet.h = glm::normalize(facet.o + facet.i);
  facet.fresnel = fresnel(glm::dot(facet.o, facet.h));
  addReflection(facet, probability * reflectProbability(facet.fresnel), v);
}

// Cook & Torrance 1982 with the terms of microfacet.h. `probability`: of reflecting at this microfacet.
void SpecularLayer::addReflection(const Facet& facet, float probability, BsdfValue& v) const {
  const float d = ggx_.D(facet.h), cosO = facet.o.z, cosI = facet.i.z;
  v.f += reflectance(facet) * (d * cosI * Ggx::visibility(cosO, stretchO_, cosI, ggx_.stretch(facet.i)));
  v.pdfW += probability * 0.25f * Ggx::visibleNormals(d, cosO, stretchO_);
}

void SpecularLayer::addTransmission(const Vec3& wi, float probability, BsdfValue& v) const {
  const Vec3 o = toGgx(wo_), i = toGgx(wi);
  Vec3 h = refractive_ ? o + eta_ * i : Vec3(o.x + i.x, o.y + i.y, o.z - i.z);
  h = glm::normalize(h.z < 0 ? -h : h);
  // TRAP: a pair that no microfacet connects; both cosines must lie on their own side.
  const float oh = glm::dot(o, h);
  if (!(oh > 0) || (refractive_ && !(glm::dot(i, h) < 0))) return;
  const Fresnel fr = fresnel(oh);
  addTransmission({o, i, h, fr}, probability * (1 - reflectProbability(fr)), v);
}

// Refraction: Walter et al. 2007 eq. 16, 17 and 21. Thin walls: the reflection's lobe seen from the other side
// (KHR_materials_transmission).
void SpecularLayer::addTransmission(const Facet& facet, float probability, BsdfValue& v) const {
  const float g1 = Ggx::G1(-facet.i.z, ggx_.stretch(facet.i));
  float density = Ggx::visibleNormals(ggx_.D(facet.h), facet.o.z, stretchO_);
  float toSolidAngle = 0.25f;
  if (refractive_) {
    const float oh = glm::dot(facet.o, facet.h), ih = glm::dot(facet.i, facet.h);
    density *= -oh * ih / sqr(oh + eta_ * ih);
    toSolidAngle = sqr(eta_);
  }
  float scale = refractive_ ? transmissionScale_ : toSolidAngle;
  if (has(kLobeMultiScatter)) scale *= glassFactor(facet.i.z);
  v.f += transmission_ * (facet.fresnel.base * density * g1 * scale);
  v.pdfW += probability * density * toSolidAngle;
}

bool SpecularLayer::sampleMicrofacet(float uLobe, const Vec2& u, float probability, BsdfSample& out,
                                     BsdfValue* v) const {
  const Vec3 o = toGgx(wo_);
  const Vec3 h = ggx_.sampleVisibleNormal(o, stretchO_, u);
  const float oh = glm::dot(o, h);
  if (!(oh > 0)) return false;
  const Fresnel fr = fresnel(oh);
  const float q = reflectProbability(fr);
  // Light that another microfacet would catch is absorbed: the model has single scattering only.
  if (uLobe < q) {
    const Vec3 i = 2 * oh * h - o;
    out.wi = fromGgx(i);
    if (i.z > 0 && v) addReflection({o, i, h, fr}, probability * q, *v);
    return i.z > 0;
  }
  Vec3 i = 2 * oh * h - o;
  i.z = -i.z;
  if (refractive_) {
    const float cosT = refractedCosine(oh, eta_);
    if (cosT < 0) return false;
    i = glm::normalize((oh / eta_ - cosT) * h - o / eta_);
  }
  out.wi = fromGgx(i);
  if (i.z < 0 && v) addTransmission({o, i, h, fr}, probability * (1 - q), *v);
  return i.z < 0;
}

// The transmitted direction at the shading normal itself.
Vec3 SpecularLayer::refractSmooth() const {
  if (!refractive_) return -wo_;
  return glm::normalize(Vec3(-wo_.x / eta_, -wo_.y / eta_, -std::max(refractedCosine(wo_.z, eta_), 1e-6f)));
}

void SpecularLayer::sampleMirror(float uLobe, float probability, BsdfSample& out) const {
  const Fresnel fr = fresnel(wo_.z);
  const float q = reflectProbability(fr);
  out.delta = true;
  out.transmitted = !(uLobe < q);
  if (out.transmitted) {
    out.straight = straight_;
    out.wi = refractSmooth();
    out.pdfW = probability * (1 - q);
    out.weight = transmission_ * (fr.base * transmissionScale_ / sqr(eta_));
  } else {
    out.wi = Vec3(-wo_.x, -wo_.y, wo_.z);
    out.pdfW = probability * q;
    out.weight = fr.reflect;
  }
}

float SpecularLayer::passThroughShare() const {
  // Between equal indices nothing is reflected and the rough reflection takes nothing; a film does reflect.
  const float below = has(kLobeIridescence) ? belowO_ : fresnel(wo_.z).base;
  return below * transmissionScale_ / sqr(eta_);
}

}  // namespace braid
