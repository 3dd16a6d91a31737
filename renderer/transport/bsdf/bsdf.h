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
#include "renderer/transport/bsdf/albedo_tables.h"
#include "renderer/transport/bsdf/fresnel.h"
#include "renderer/transport/bsdf/microfacet.h"
#include "renderer/transport/bsdf/sheen.h"
#include "renderer/transport/bsdf/surface.h"
#include "renderer/transport/bsdf/warp.h"

namespace braid {

struct BsdfValue {
  Spectrum f{0};      // BSDF · |cos(wi, shading normal)|; delta lobes excluded
  float pdfW = 0;     // solid-angle density with which sample() picks wi given wo; delta lobes excluded
  float pdfRevW = 0;  // the same with the roles of wo and wi exchanged; filled only when asked for
};

struct BsdfSample {
  Vec3 wi{0, 0, 1};
  Spectrum weight{0};  // f · |cos| / pdf of the whole lobe set (non-delta), or of the delta lobe alone; never negative
  float pdfW = 0;      // density of the whole lobe set; for a delta lobe the discrete probability of picking it
  bool delta = false;
  bool transmitted = false;  // wi is on the other side of the surface than wo
  bool straight = false;     // delta, along -wo through a pane: no event, whatever wi says below a shading horizon
};

// What travels from wi to wo: radiance on paths from the eye, importance's dual on paths from a light.
// Radiance changes by 1/eta² when it crosses into a denser medium, power does not (Veach 1997, section 5.2).
enum class Transport : uint8_t { Radiance, Power };

// Lobes by what a photon map can do for them. Broad: diffuse, diffuse transmission, sheen, and GGX lobes with alpha of
// at least kBroadAlpha: few photons do. Narrow: the rest, where next to no photon would come from the lobe.
enum class LobeGroup : uint8_t { All, Broad, Narrow };
inline constexpr float kBroadAlpha = 0.3f;

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
  Spectrum straightTransmittance() const { return diffuseOnly_ || !straight_ ? Spectrum(0) : transmittance(); }
  bool passesStraight() const { return !diffuseOnly_ && straight_; }
  // Whether evaluate() can be non-zero.
  bool hasNonDelta() const { return diffuseOnly_ || nonDelta_; }
  // Directional reflectance for wo, each channel in [0, 1]: a feature for denoisers, smooth rather than exact.
  Spectrum albedo() const { return diffuseOnly_ ? diffuse_ : layersAlbedo(); }
  bool diffuseOnly() const { return diffuseOnly_; }
  // Probability that sample() picks a broad lobe: 1 for diffuse surfaces, 0 also for black ones.
  float broadShare() const { return diffuseOnly_ ? 1.0f : layersBroadShare(); }
  // The lobes of one group alone, as the layers above leave them: values add up to those of all lobes, probabilities of
  // selection are renormalised. albedo() stays that of all lobes.
  Bsdf restricted(LobeGroup group) const;
  // The factor 1/eta² in f and weight of specular transmission under Transport::Radiance; 1 when there is none.
  float radianceScale() const { return diffuseOnly_ ? 1.0f : radianceScale_; }

 private:
  // Probability of picking each group of lobes; sums to 1, or is all 0 for black surfaces.
  struct Selection {
    float diffuse, diffuseTransmission;
    float specular;     // reflection, together with transmission when both share the microfacet
    float passThrough;  // transmission on its own: smooth although the reflection is rough
    float sheen, clearcoat;
  };
  struct LobeAlbedos {
    Spectrum diffuse{0}, diffuseTransmission{0}, reflection{0}, transmission{0}, sheen{0}, clearcoat{0};
  };
  struct FresnelTerm {
    Spectrum reflect;  // of dielectric and metal, mixed
    float base;        // 1 - maximum component of the dielectric's: what is left for the lobes below
  };

  static Vec3 aboveHorizon(const Vec3& w) {
    constexpr float kMinCosine = 1e-4f;
    const float z = std::fabs(w.z);
    return z >= kMinCosine ? Vec3(w.x, w.y, z) : glm::normalize(Vec3(w.x, w.y, kMinCosine));
  }

  // bsdf.cpp: set-up, lobe selection, the public operations
  void initLayers(const SurfaceParameters& p, Transport transport);
  void initSpecular(const SurfaceParameters& p);
  void initDistribution(const SurfaceParameters& p);
  void initBelowSpecular();
  void initDirection();
  Bsdf reversed(const Vec3& wi) const;
  LobeAlbedos lobeAlbedos(bool smooth) const;
  Selection select() const;

  // lobe_groups.cpp
  uint32_t broadLobes() const;
  float layersBroadShare() const;
  Selection restrictedTo(LobeGroup group, Selection s) const;

  Spectrum layersAlbedo() const;
  BsdfValue evaluateLayers(const Vec3& wi, bool reverse) const;
  bool sampleLayers(float uLobe, const Vec2& u, BsdfSample& out) const;
  bool sampleDirection(float uLobe, const Vec2& u, BsdfSample& out, BsdfValue& v) const;

  // lobes_specular.cpp: Fresnel terms, GGX reflection and transmission
  FresnelTerm fresnel(float cosine) const;
  FresnelTerm fresnelGeneral(float cosine) const;
  float reflectProbability(const FresnelTerm& f) const;
  Vec3 toGgx(const Vec3& w) const;
  Vec3 fromGgx(const Vec3& w) const;
  void addReflection(const Vec3& wi, BsdfValue& v) const;
  void addReflection(const Vec3& o, const Vec3& i, const Vec3& h, const FresnelTerm& fr, float q, BsdfValue& v) const;
  void addTransmission(const Vec3& wi, BsdfValue& v) const;
  void addTransmission(const Vec3& o, const Vec3& i, const Vec3& h, const FresnelTerm& fr, float q, BsdfValue& v) const;
  bool sampleMicrofacet(float uLobe, const Vec2& u, BsdfSample& out, BsdfValue& v) const;
  Vec3 refractSmooth() const;
  bool sampleMirror(float uLobe, BsdfSample& out) const;
  Spectrum transmittance() const;
  bool samplePassThrough(BsdfSample& out) const;

  // lobes_layers.cpp: what covers the base, and how much light it lets through
  void initSheen(const SurfaceParameters& p);
  void initClearcoat(const SurfaceParameters& p);
  void initMeanAlbedo();
  float dielectricAlbedo(const GgxAlbedo& e) const { return std::min(baseF0_ * e.f0 + baseF90_ * e.f90, 1.0f); }
  float dielectricAlbedo(int side, float cosine) const;
  float diffuseBelowSpecular(const Vec3& wi) const;
  float belowSheen(float albedo) const;
  float belowSheen(const Vec3& wi) const;
  float belowClearcoat(float cosine) const;
  float belowClearcoat(const Vec3& wi) const;
  float belowLayers(const Vec3& wi) const;
  void addLayers(const Vec3& wi, BsdfValue& v) const;
  Vec3 clearcoatDirection(const Frame& frame) const;
  void addSheen(const Vec3& wi, BsdfValue& v) const;
  void addClearcoat(const Vec3& wi, BsdfValue& v) const;
  bool sampleClearcoat(const Vec2& u, BsdfSample& out) const;

  bool has(uint32_t lobe) const { return (lobes_ & lobe) != 0; }
  bool scatters(uint32_t lobe) const { return (scatter_ & lobe) != 0; }

  Vec3 wo_;
  Spectrum diffuse_;  // colour of the diffuse reflection with its share of the mix
  bool diffuseOnly_;

  // TRAP: everything below is written by initLayers() only; the diffuse path must not pay for it nor read it.
  bool nonDelta_;
  bool general_;                   // the Fresnel term is no plain Schlick curve
  bool refractive_;                // a solid with a refractive index: Snell's law applies
  bool smooth_;                    // the specular lobe is a mirror
  bool straight_;                  // a pane: thin, and its transmission a delta
  bool passThrough_;               // transmission is smooth although the reflection is not
  bool microfacetOnly_;            // no lobe but GGX reflection and transmission
  bool weighsDiffuse_;             // diffuse lobes lie below a specular layer
  bool coatedHere_, coatedThere_;  // clearcoat and sheen on the side of wo, on the other side
  bool entering_;
  LobeGroup group_;   // of the lobes that scatter
  uint32_t lobes_;    // the lobes that are not black, and modifiers
  uint32_t scatter_;  // those of the group; the others only take light away from what lies below them

  Spectrum diffuseTransmission_, transmission_;  // colours with their share of the mix

  // Specular layer: Schlick end points of dielectric and metal mixed, and of the dielectric's maximum alone.
  Spectrum f0_;
  float f90_, baseF0_, baseF90_;
  Ggx ggx_;
  Vec2 tangent_;
  float stretchO_;
  float eta_;            // index on the other side over index on the side of wo
  float radianceScale_;  // 1/eta²
  float transmissionScale_;
  TableRow row_, rowAcross_;

  // For general_ only.
  Spectrum dielectricF0_, metalF0_;
  float weight_, metallic_, iridescence_;
  ThinFilm film_;

  // Albedo of the dielectric layer seen from either side (0: that of wo), for weighsDiffuse_ and passThrough_.
  std::array<std::array<float, kFresnelNodes>, 2> curve_;
  float meanAlbedo_[2];
  float belowSpecularO_;  // 1 - E(wo)
  GgxAlbedo albedoO_;     // of the specular layer for wo

  Spectrum sheenColor_;
  float sheenMax_, sheenAlbedoO_, sheenBelowO_;
  Charlie charlie_;
  TableRow sheenRow_;

  float clearcoat_, clearcoatCosO_, clearcoatBelowO_;
  Ggx clearcoatGgx_;
  bool clearcoatSmooth_;
  Vec3 clearcoatNormal_;
  TableRow clearcoatRow_;

  Selection select_;
};

}  // namespace braid
