// SPDX-License-Identifier: Apache-2.0
// The glTF material model as one struct of lobes. All directions are unit, in the local shading frame (z = shading
// normal, turned to the side of wo), pointing away from the surface. wo points toward the previous vertex, wi is
// sampled or asked for.
//
// Layering, from the top (glTF 2.0 appendix B and the KHR_materials_* extensions):
//   clearcoat over sheen over mix(dielectric, metal, metallic),
//   dielectric = specular over mix(mix(diffuse, diffuse transmission), transmission).
// Where the specification offers a choice, the one that conserves energy and is reciprocal is taken:
//   - diffuse lobes below specular get (1 - E(wo))(1 - E(wi)) / (1 - mean E), E the albedo of the specular layer
//     (Kulla & Conty 2017), in place of 1 - F(VdotH), which at grazing angles adds up to more than the incoming light;
//   - specular transmission shares its microfacet with the reflection and gets exactly 1 - F(VdotH);
//   - clearcoat and sheen leave min(1 - E(wo), 1 - E(wi)) to what is below, KHR_materials_sheen's own rule.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "renderer/core/vec.h"
#include "renderer/transport/bsdf/covers.h"
#include "renderer/transport/bsdf/scattering.h"
#include "renderer/transport/bsdf/specular_layer.h"
#include "renderer/transport/bsdf/surface.h"
#include "renderer/transport/bsdf/warp.h"

namespace braid {

class Bsdf {
 public:
  // wo may lie on or below the horizon of the shading normal (interpolated normals): it is mirrored and lifted to it.
  Bsdf(const SurfaceParameters& p, const Vec3& wo, Transport transport = Transport::Radiance)
      : wo_(aboveHorizon(wo)), diffuse_(p.baseColor), diffuseOnly_(p.lobes == kLobeDiffuse) {
    if (!diffuseOnly_) initLayers(p, transport);
  }

  // A purely diffuse surface, without the detour over SurfaceParameters.
  Bsdf(const Spectrum& albedo, const Vec3& wo) : wo_(aboveHorizon(wo)), diffuse_(albedo), diffuseOnly_(true) {}

  BsdfValue evaluate(const Vec3& wi, bool reverse = false) const {
    if (!diffuseOnly_) return evaluateLayers(wi, reverse);
    BsdfValue v;
    if (wi.z > 0) {
      v.pdfW = wi.z * kInvPi;
      v.f = diffuse_ * v.pdfW;
      v.pdfRevW = wo_.z * kInvPi;
    }
    return v;
  }

  // uLobe picks the lobe, u the direction. False: absorbed, which is part of the estimate.
  bool sample(float uLobe, const Vec2& u, BsdfSample& out) const {
    if (!diffuseOnly_) return sampleLayers(uLobe, u, out);
    out.wi = squareToCosineHemisphere(u);
    out.weight = diffuse_;
    out.pdfW = out.wi.z * kInvPi;
    out.delta = out.transmitted = out.straight = false;
    return true;
  }

  // What a thin, smooth surface lets straight through, 0 for all others: by BSDF sampling, weight · pdf of samples that
  // are `straight`. The same from both sides.
  Spectrum straightTransmittance() const { return passesStraight() ? transmittance() : Spectrum(0); }
  bool passesStraight() const { return !diffuseOnly_ && specular_.straight(); }
  // Whether evaluate() can be non-zero.
  bool hasNonDelta() const { return diffuseOnly_ || nonDelta_; }
  // Directional reflectance for wo, each channel in [0, 1]: a feature for denoisers, smooth rather than exact.
  Spectrum albedo() const { return diffuseOnly_ ? diffuse_ : layersAlbedo(); }
  bool diffuseOnly() const { return diffuseOnly_; }
  // Probability that sample() picks a broad lobe: 1 for diffuse surfaces, 0 also for black ones.
  float broadShare() const { return diffuseOnly_ ? 1.0f : layersBroadShare(); }
  // Probability that sample() picks a delta lobe, and whether it does so for this uLobe.
  float deltaShare() const { return diffuseOnly_ ? 0.0f : layersDeltaShare(); }
  bool picksDelta(float uLobe) const { return !diffuseOnly_ && layersPickDelta(uLobe); }
  // The lobes of one group alone, as the layers above leave them: values add up to those of all lobes, probabilities of
  // selection are renormalised. albedo() stays that of all lobes.
  Bsdf restricted(LobeGroup group) const;
  // The factor 1/eta² in f and weight of specular transmission under Transport::Radiance; 1 when there is none.
  float radianceScale() const { return diffuseOnly_ ? 1.0f : specular_.radianceScale(); }

 private:
  // What sample() picks from: the lobes, but reflection and transmission that share a microfacet are one, and
  // transmission that is smooth below a rough reflection is another.
  enum Slot : size_t { kDiffuse, kDiffuseTransmission, kSpecular, kPassThrough, kFirstCover };
  static constexpr size_t kSlots = kFirstCover + Covers::kCount;
  // Of picking each slot; the sum is 1, or 0 for black surfaces.
  using Probabilities = std::array<float, kSlots>;
  struct Albedos {
    Spectrum diffuse{0}, diffuseTransmission{0};
    SpecularLayer::Albedos specular;
    std::array<Spectrum, Covers::kCount> covers{};
  };
  static constexpr uint32_t kDiffuseLobes = kLobeDiffuse | kLobeDiffuseTransmission;
  static uint32_t lobeOf(size_t slot);
  static constexpr bool alwaysBroad(size_t slot) {
    return slot <= kDiffuseTransmission || (slot >= kFirstCover && Covers::kAlwaysBroad[slot - kFirstCover]);
  }
  // Samples stay the same as long as this order does.
  static constexpr std::array<size_t, kSlots> pickingOrder() {
    std::array<size_t, kSlots> order{kSpecular};
    size_t n = 1;
    const auto addCovers = [&](bool broad) {
      for (size_t slot = kFirstCover; slot < kSlots; ++slot)
        if (alwaysBroad(slot) == broad) order[n++] = slot;
    };
    addCovers(false);
    for (const Slot slot : {kPassThrough, kDiffuse, kDiffuseTransmission}) order[n++] = slot;
    addCovers(true);
    return order;
  }

  static Vec3 aboveHorizon(const Vec3& w) {
    constexpr float kMinCosine = 1e-4f;
    const float z = std::fabs(w.z);
    return z >= kMinCosine ? Vec3(w.x, w.y, z) : glm::normalize(Vec3(w.x, w.y, kMinCosine));
  }

  void initLayers(const SurfaceParameters& p, Transport transport);
  void setScattering(LobeGroup group, uint32_t lobes);
  void initDirection();
  Bsdf reversed(const Vec3& wi) const;

  Albedos albedos(bool exact) const;
  Spectrum layersAlbedo() const;
  Spectrum transmittance() const;
  BsdfValue evaluateLayers(const Vec3& wi, bool reverse) const;
  float belowCovers(const Vec3& wi) const;
  void addCovers(const Vec3& wi, BsdfValue& v) const;

  Probabilities select() const;
  bool sampleLayers(float uLobe, const Vec2& u, BsdfSample& out) const;
  bool sampleSlot(size_t slot, float uLobe, const Vec2& u, BsdfSample& out, BsdfValue& v) const;
  bool samplePassThrough(BsdfSample& out) const;
  bool isDelta(size_t slot) const;
  float layersDeltaShare() const;
  bool layersPickDelta(float uLobe) const;

  // lobe_groups.cpp
  uint32_t broadLobes() const;
  float layersBroadShare() const;
  Probabilities restrictedTo(LobeGroup group, Probabilities p) const;

  bool has(uint32_t lobe) const { return (lobes_ & lobe) != 0; }
  bool scatters(uint32_t lobe) const { return (scatter_ & lobe) != 0; }

  Vec3 wo_;
  Spectrum diffuse_;  // colour of the diffuse reflection with its share of the mix
  bool diffuseOnly_;

  // TRAP: everything below is written by initLayers() only; the diffuse path must not pay for it nor read it.
  bool nonDelta_;
  bool microfacetOnly_;            // nothing but GGX reflection and transmission has a value
  bool coatedHere_, coatedThere_;  // covers on the side of wo, on the other side
  LobeGroup group_;                // of the lobes that scatter
  uint32_t lobes_;                 // the lobes that are not black, and modifiers
  uint32_t scatter_;               // those of the group; the others only take light away from what lies below them

  Spectrum diffuseTransmission_;  // as diffuse_
  SpecularLayer specular_;
  Covers covers_;
  Probabilities select_;
};

}  // namespace braid
