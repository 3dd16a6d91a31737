// SPDX-License-Identifier: Apache-2.0
// Set-up of the layers, the choice among their lobes, and the public operations. Groups of lobes: lobe_groups.cpp.
#include "renderer/transport/bsdf/bsdf.h"

namespace braid {

namespace {

// What a cover leaves of the light from wi that the base scatters to wo: KHR_materials_sheen's minimum, reciprocal and
// never more than the light that was not reflected. Only sides that carry the cover count.
template <class Cover>
float belowCover(const Cover& cover, bool coatedO, bool coatedI, const Vec3& wi) {
  return std::min(coatedO ? cover.below() : 1.0f, coatedI ? cover.below(wi) : 1.0f);
}

}  // namespace

void Bsdf::initLayers(const SurfaceParameters& p, Transport transport) {
  lobes_ = Covers::present(p, p.lobes);
  const float through = has(kLobeDiffuseTransmission) ? p.diffuseTransmission : 0.0f;
  const float share = (1 - p.metalShare()) * (1 - p.transmissionShare());
  Spectrum diffuseColor = p.baseColor;
  if (has(kLobeSpecularGlossiness)) diffuseColor *= std::max(1 - maxComponent(p.specularF0), 0.0f);
  diffuse_ = has(kLobeDiffuse) ? diffuseColor * (share * (1 - through)) : Spectrum(0);
  diffuseTransmission_ = has(kLobeDiffuseTransmission) ? p.diffuseTransmissionColor * (share * through) : Spectrum(0);
  if (!anyPositive(diffuse_)) lobes_ &= ~uint32_t{kLobeDiffuse};
  if (!anyPositive(diffuseTransmission_)) lobes_ &= ~uint32_t{kLobeDiffuseTransmission};
  lobes_ = specular_.init(p, lobes_, transport);

  // A coat covers the outside; a thin wall has two outsides.
  coatedHere_ = p.thinWalled || p.entering;
  coatedThere_ = p.thinWalled || !p.entering;
  covers_.upward([&](auto& cover, size_t) {
    if (has(cover.kLobe)) cover.init(p);
  });

  // What remains may be a plain diffuse surface, for instance with specular 0.
  diffuseOnly_ = lobes_ == kLobeDiffuse;
  setScattering(LobeGroup::All, lobes_);
  if (!diffuseOnly_) initDirection();
}

void Bsdf::setScattering(LobeGroup group, uint32_t lobes) {
  group_ = group;
  scatter_ = lobes;
  // Covers count even if they do not scatter: they take light away from the microfacets.
  microfacetOnly_ = !scatters(kDiffuseLobes) && !has(Covers::kLobes) && !specular_.passesThrough();
  nonDelta_ = scatters(kDiffuseLobes) || (scatters(SpecularLayer::kLobes) && !specular_.smooth());
  covers_.upward([&](const auto& cover, size_t) {
    if (scatters(cover.kLobe) && coatedHere_ && !cover.smooth()) nonDelta_ = true;
  });
}

void Bsdf::initDirection() {
  if (specular_.present()) specular_.setDirection(wo_);
  covers_.upward([&](auto& cover, size_t) {
    if (has(cover.kLobe) && coatedHere_) cover.setDirection(wo_);
  });
  select_ = select();
}

Bsdf Bsdf::reversed(const Vec3& wi) const {
  Bsdf b = *this;
  b.wo_ = aboveHorizon(wi);
  if (wi.z < 0) {
    if (specular_.present()) b.specular_.turn();
    std::swap(b.coatedHere_, b.coatedThere_);
    b.covers_.upward([&](auto& cover, size_t) {
      if (has(cover.kLobe)) cover.turn();
    });
  }
  b.initDirection();
  return b;
}

// exact = false: ignores what roughness does to the albedo.
Bsdf::Albedos Bsdf::albedos(bool exact) const {
  Albedos a;
  const float below = specular_.below();
  a.diffuse = diffuse_ * below;
  a.diffuseTransmission = diffuseTransmission_ * below;
  if (specular_.present()) a.specular = specular_.albedos(exact);
  Spectrum above(1);
  covers_.downward([&](const auto& cover, size_t i) {
    if (!has(cover.kLobe) || !coatedHere_) return;
    a.covers[i] = cover.albedo(above);
    above *= cover.below();
  });
  a.diffuse *= above;
  a.diffuseTransmission *= above;
  a.specular.reflection *= above;
  a.specular.transmission *= above;
  return a;
}

Spectrum Bsdf::layersAlbedo() const {
  const Albedos a = albedos(false);
  Spectrum sum = a.diffuse + a.diffuseTransmission + a.specular.reflection + a.specular.transmission;
  for (const Spectrum& cover : a.covers) sum += cover;
  return glm::clamp(sum, Spectrum(0), Spectrum(1));
}

Spectrum Bsdf::transmittance() const {
  return specular_.transmission() * (specular_.transmittance() * belowCovers(-wo_));
}

Bsdf::Probabilities Bsdf::select() const {
  Probabilities p{};
  if (specular_.present() && microfacetOnly_) {
    p[kSpecular] = 1;
    return group_ == LobeGroup::All ? p : restrictedTo(group_, p);
  }
  const Albedos a = albedos(true);
  p[kDiffuse] = average(a.diffuse);
  p[kDiffuseTransmission] = average(a.diffuseTransmission);
  p[kSpecular] = average(a.specular.reflection);
  p[specular_.passesThrough() ? kPassThrough : kSpecular] += average(a.specular.transmission);
  for (size_t i = 0; i < Covers::kCount; ++i) p[kFirstCover + i] = average(a.covers[i]);

  float total = 0, count = 0;
  for (const float w : p) {
    total += w;
    count += w > 0 ? 1.0f : 0.0f;
  }
  if (!(total > 0)) return Probabilities{};
  // The albedos are estimates: every lobe keeps a share, which bounds the weight of what an estimate missed.
  constexpr float kFloor = 0.05f;
  const float scale = 1 / (total * (1 + kFloor * count));
  for (float& w : p) w = w > 0 ? (w + kFloor * total) * scale : 0.0f;
  return group_ == LobeGroup::All ? p : restrictedTo(group_, p);
}

BsdfValue Bsdf::evaluateLayers(const Vec3& wi, bool reverse) const {
  BsdfValue v;
  if (!nonDelta_ || wi.z == 0) return v;
  if (wi.z > 0) {
    if (scatters(kLobeDiffuse)) {
      const float cosine = wi.z * kInvPi;
      v.f = diffuse_ * (cosine * specular_.belowToward(wi));
      v.pdfW = select_[kDiffuse] * cosine;
    }
    if (scatters(SpecularLayer::kLobes) && !specular_.smooth()) specular_.addReflection(wi, select_[kSpecular], v);
  } else {
    if (scatters(kLobeDiffuseTransmission)) {
      const float cosine = -wi.z * kInvPi;
      v.f = diffuseTransmission_ * (cosine * specular_.belowToward(wi));
      v.pdfW = select_[kDiffuseTransmission] * cosine;
    }
    if (scatters(kLobeTransmission) && !specular_.smooth() && !specular_.passesThrough())
      specular_.addTransmission(wi, select_[kSpecular], v);
  }
  if (has(Covers::kLobes)) addCovers(wi, v);
  if (reverse) {
    const Vec3 back = wi.z > 0 ? wo_ : Vec3(wo_.x, wo_.y, -wo_.z);
    v.pdfRevW = reversed(wi).evaluateLayers(back, false).pdfW;
  }
  return v;
}

float Bsdf::belowCovers(const Vec3& wi) const {
  float share = 1;
  const bool coatedI = wi.z > 0 ? coatedHere_ : coatedThere_;
  covers_.upward([&](const auto& cover, size_t) {
    if (has(cover.kLobe)) share *= belowCover(cover, coatedHere_, coatedI, wi);
  });
  return share;
}

void Bsdf::addCovers(const Vec3& wi, BsdfValue& v) const {
  const bool reflects = wi.z > 0 && coatedHere_, coatedI = wi.z > 0 ? coatedHere_ : coatedThere_;
  covers_.upward([&](const auto& cover, size_t i) {
    if (!has(cover.kLobe)) return;
    v.f *= belowCover(cover, coatedHere_, coatedI, wi);
    if (reflects && !cover.smooth() && scatters(cover.kLobe)) cover.add(wo_, wi, select_[kFirstCover + i], v);
  });
}

bool Bsdf::sampleLayers(float uLobe, const Vec2& u, BsdfSample& out) const {
  out.delta = out.transmitted = out.straight = false;
  BsdfValue v;
  constexpr std::array<size_t, kSlots> kOrder = pickingOrder();
  bool found = false;
  for (const size_t slot : kOrder) {
    if (uLobe < select_[slot]) {
      found = sampleSlot(slot, std::min(uLobe / select_[slot], kOneMinusEpsilon), u, out, v);
      break;
    }
    uLobe -= select_[slot];
  }
  if (!found) return false;
  if (out.delta) return out.pdfW > 0;
  if (!microfacetOnly_) v = evaluateLayers(out.wi, false);
  if (!(v.pdfW > 0)) return false;
  out.pdfW = v.pdfW;
  out.weight = v.f / v.pdfW;
  out.transmitted = out.wi.z < 0;
  return true;
}

// A direction from a lobe. Delta lobes fill in everything, microfacets on their own v, the others wi alone.
bool Bsdf::sampleSlot(size_t slot, float uLobe, const Vec2& u, BsdfSample& out, BsdfValue& v) const {
  if (slot == kSpecular) {
    if (!specular_.smooth())
      return specular_.sampleMicrofacet(uLobe, u, select_[slot], out, microfacetOnly_ ? &v : nullptr);
    specular_.sampleMirror(uLobe, select_[slot], out);
    out.weight *= belowCovers(out.wi) / out.pdfW;
    return true;
  }
  if (slot == kPassThrough) return samplePassThrough(out);
  if (slot < kFirstCover) {
    const Vec3 w = squareToCosineHemisphere(u);
    out.wi = Vec3(w.x, w.y, slot == kDiffuse ? w.z : -w.z);
    return true;
  }
  bool found = false;
  covers_.upward([&](const auto& cover, size_t i) {
    if (kFirstCover + i == slot) found = cover.sample(wo_, u, select_[slot], out);
  });
  return found;
}

bool Bsdf::samplePassThrough(BsdfSample& out) const {
  out.delta = out.transmitted = true;
  out.wi = specular_.passThroughDirection();
  out.pdfW = select_[kPassThrough];
  out.weight = specular_.transmission() * (specular_.passThroughShare() * belowCovers(out.wi) / out.pdfW);
  return true;
}

bool Bsdf::isDelta(size_t slot) const {
  if (slot == kPassThrough) return true;
  if (slot < kFirstCover) return slot == kSpecular && specular_.smooth();
  bool smooth = false;
  covers_.upward([&](const auto& cover, size_t i) {
    if (kFirstCover + i == slot) smooth = cover.smooth();
  });
  return smooth;
}

float Bsdf::layersDeltaShare() const {
  float share = 0;
  for (size_t slot = 0; slot < kSlots; ++slot)
    if (select_[slot] > 0 && isDelta(slot)) share += select_[slot];
  return share;
}

bool Bsdf::layersPickDelta(float uLobe) const {
  constexpr std::array<size_t, kSlots> kOrder = pickingOrder();
  for (const size_t slot : kOrder) {
    if (uLobe < select_[slot]) return isDelta(slot);
    uLobe -= select_[slot];
  }
  return false;
}

}  // namespace braid
