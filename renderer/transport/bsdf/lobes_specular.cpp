// SPDX-License-Identifier: Apache-2.0
// The specular layer: its Fresnel term, GGX reflection, refraction into a solid, and blurred passage through a thin
// wall.
#include <algorithm>
#include <cmath>

#include "renderer/transport/bsdf/bsdf.h"

namespace braid {

// VdotH in, reflectance and what it leaves out. Schlick for opaque and thin surfaces (glTF 2.0 appendix B.3.4).
Bsdf::FresnelTerm Bsdf::fresnel(float cosine) const {
  if (general_) return fresnelGeneral(cosine);
  const float s = schlickWeight(cosine);
  return {f0_ + (f90_ - f0_) * s, 1 - (baseF0_ + (baseF90_ - baseF0_) * s)};
}

// The exact dielectric on a solid that lets light through, and thin films. Both are functions of the angle outside, so
// that light leaving along a path meets the reflectance it met entering.
Bsdf::FresnelTerm Bsdf::fresnelGeneral(float cosine) const {
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
float Bsdf::reflectProbability(const FresnelTerm& f) const {
  if (!has(kLobeTransmission) || passThrough_) return 1;
  const float r = average(f.reflect), t = average(transmission_) * f.base;
  return r + t > 0 ? r / (r + t) : 0.0f;
}

Vec3 Bsdf::toGgx(const Vec3& w) const {
  if (!has(kLobeAnisotropy)) return w;
  return Vec3(w.x * tangent_.x + w.y * tangent_.y, w.y * tangent_.x - w.x * tangent_.y, w.z);
}

Vec3 Bsdf::fromGgx(const Vec3& w) const {
  if (!has(kLobeAnisotropy)) return w;
  return Vec3(w.x * tangent_.x - w.y * tangent_.y, w.y * tangent_.x + w.x * tangent_.y, w.z);
}

void Bsdf::addReflection(const Vec3& wi, BsdfValue& v) const {
  const Vec3 o = toGgx(wo_), i = toGgx(wi);
  const Vec3 h = glm::normalize(o + i);
  const FresnelTerm fr = fresnel(glm::dot(o, h));
  addReflection(o, i, h, fr, reflectProbability(fr), v);
}

// Cook & Torrance 1982 with the terms of microfacet.h. q: probability of reflecting at this microfacet.
void Bsdf::addReflection(const Vec3& o, const Vec3& i, const Vec3& h, const FresnelTerm& fr, float q,
                         BsdfValue& v) const {
  const float d = ggx_.D(h);
  v.f += fr.reflect * (d * i.z * Ggx::visibility(o.z, stretchO_, i.z, ggx_.stretch(i)));
  v.pdfW += select_.specular * q * 0.25f * Ggx::visibleNormals(d, o.z, stretchO_);
}

void Bsdf::addTransmission(const Vec3& wi, BsdfValue& v) const {
  const Vec3 o = toGgx(wo_), i = toGgx(wi);
  Vec3 h = refractive_ ? o + eta_ * i : Vec3(o.x + i.x, o.y + i.y, o.z - i.z);
  h = glm::normalize(h.z < 0 ? -h : h);
  // TRAP: a pair that no microfacet connects; both cosines must lie on their own side.
  const float oh = glm::dot(o, h);
  if (!(oh > 0) || (refractive_ && !(glm::dot(i, h) < 0))) return;
  const FresnelTerm fr = fresnel(oh);
  addTransmission(o, i, h, fr, reflectProbability(fr), v);
}

// Refraction: Walter et al. 2007 eq. 16, 17 and 21. Thin walls: the reflection's lobe seen from the other side
// (KHR_materials_transmission).
void Bsdf::addTransmission(const Vec3& o, const Vec3& i, const Vec3& h, const FresnelTerm& fr, float q,
                           BsdfValue& v) const {
  const float g1 = Ggx::G1(-i.z, ggx_.stretch(i));
  float density = Ggx::visibleNormals(ggx_.D(h), o.z, stretchO_);
  float toSolidAngle = 0.25f;
  if (refractive_) {
    const float oh = glm::dot(o, h), ih = glm::dot(i, h);
    density *= -oh * ih / sqr(oh + eta_ * ih);
    toSolidAngle = sqr(eta_);
  }
  const float scale = refractive_ ? transmissionScale_ : toSolidAngle;
  v.f += transmission_ * (fr.base * density * g1 * scale);
  v.pdfW += select_.specular * (1 - q) * density * toSolidAngle;
}

// Fills in v when there is no other lobe to evaluate: the microfacet is at hand.
bool Bsdf::sampleMicrofacet(float uLobe, const Vec2& u, BsdfSample& out, BsdfValue& v) const {
  const Vec3 o = toGgx(wo_);
  const Vec3 h = ggx_.sampleVisibleNormal(o, stretchO_, u);
  const float oh = glm::dot(o, h);
  if (!(oh > 0)) return false;
  const FresnelTerm fr = fresnel(oh);
  const float q = reflectProbability(fr);
  // Light that another microfacet would catch is absorbed: the model has single scattering only.
  if (uLobe < q) {
    const Vec3 i = 2 * oh * h - o;
    out.wi = fromGgx(i);
    if (i.z > 0 && microfacetOnly_) addReflection(o, i, h, fr, q, v);
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
  if (i.z < 0 && microfacetOnly_) addTransmission(o, i, h, fr, q, v);
  return i.z < 0;
}

// The transmitted direction at the shading normal itself.
Vec3 Bsdf::refractSmooth() const {
  if (!refractive_) return -wo_;
  return glm::normalize(Vec3(-wo_.x / eta_, -wo_.y / eta_, -std::max(refractedCosine(wo_.z, eta_), 1e-6f)));
}

bool Bsdf::sampleMirror(float uLobe, BsdfSample& out) const {
  const FresnelTerm fr = fresnel(wo_.z);
  const float q = reflectProbability(fr);
  out.delta = true;
  out.transmitted = !(uLobe < q);
  if (out.transmitted) {
    out.straight = straight_;
    out.wi = refractSmooth();
    out.pdfW = select_.specular * (1 - q);
    out.weight = transmission_ * (fr.base * transmissionScale_ / sqr(eta_));
  } else {
    out.wi = Vec3(-wo_.x, -wo_.y, wo_.z);
    out.pdfW = select_.specular * q;
    out.weight = fr.reflect;
  }
  out.weight *= belowLayers(out.wi) / out.pdfW;
  return true;
}

// Of a pane: sampleMirror()'s transmission without its probability.
Spectrum Bsdf::transmittance() const { return transmission_ * (fresnel(wo_.z).base * belowLayers(-wo_)); }

bool Bsdf::samplePassThrough(BsdfSample& out) const {
  const FresnelTerm fr = fresnel(wo_.z);
  // Between equal indices nothing is reflected and the rough reflection takes nothing; a film does reflect.
  const float below = has(kLobeIridescence) ? belowSpecularO_ : fr.base;
  out.delta = out.transmitted = true;
  out.wi = refractSmooth();
  out.pdfW = select_.passThrough;
  out.weight = transmission_ * (below * transmissionScale_ / sqr(eta_) * belowLayers(out.wi) / out.pdfW);
  return true;
}

}  // namespace braid
