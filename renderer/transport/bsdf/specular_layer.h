// SPDX-License-Identifier: Apache-2.0
// The specular layer: its Fresnel term, GGX reflection, refraction into a solid, blurred passage through a thin wall,
// and how much light it leaves to the diffuse lobes below. Its microfacets are shared by reflection and transmission.
#pragma once

#include <algorithm>
#include <array>

#include "renderer/transport/bsdf/albedo_tables.h"
#include "renderer/transport/bsdf/fresnel.h"
#include "renderer/transport/bsdf/microfacet.h"
#include "renderer/transport/bsdf/multi_scatter.h"
#include "renderer/transport/bsdf/scattering.h"
#include "renderer/transport/bsdf/surface.h"

namespace braid {

// TRAP: the members of a layer that is not there stay uninitialised, but for the flags that init() clears.
class SpecularLayer {
 public:
  static constexpr uint32_t kLobes = kLobeSpecular | kLobeTransmission;
  struct Fresnel {
    Spectrum reflect;  // of dielectric and metal, mixed
    float base;        // 1 - maximum component of the dielectric's: what is left for the lobes below
  };
  struct Albedos {
    Spectrum reflection{0}, transmission{0};
  };

  // `lobes`: of the whole surface. Returns them without those that turn out to do nothing.
  uint32_t init(const SurfaceParameters& p, uint32_t lobes, Transport transport);
  // What follows is for this direction.
  void setDirection(const Vec3& wo);
  // The same surface, seen from its other side.
  void turn();

  bool present() const { return (lobes_ & kLobes) != 0; }
  bool smooth() const { return smooth_; }  // a mirror, and a clear pane or solid
  // Transmission is smooth although the reflection is rough.
  bool passesThrough() const { return passThrough_; }
  bool straight() const { return straight_; }  // a pane: thin, and its transmission a delta
  bool broad() const { return present() && !smooth_ && std::min(ggx_.alphaX, ggx_.alphaY) >= kBroadAlpha; }
  float radianceScale() const { return radianceScale_; }

  // The factor by which light from wi reaches diffuse lobes and leaves them toward wo.
  float belowToward(const Vec3& wi) const;
  // The same for all wi, seen from wo alone.
  float below() const { return weighsDiffuse_ ? belowO_ : 1.0f; }
  // Directional albedos. exact = false: a smooth guess that ignores what roughness does.
  Albedos albedos(bool exact) const;

  // Value and density; `probability` is that of picking the layer.
  void addReflection(const Vec3& wi, float probability, BsdfValue& v) const;
  void addTransmission(const Vec3& wi, float probability, BsdfValue& v) const;
  // Fills in v, unless null: the microfacet is at hand.
  bool sampleMicrofacet(float uLobe, const Vec2& u, float probability, BsdfSample& out, BsdfValue* v) const;
  // Those of delta lobes leave it to the caller to multiply by what the covers let through.
  void sampleMirror(float uLobe, float probability, BsdfSample& out) const;
  Vec3 passThroughDirection() const { return refractSmooth(); }
  float passThroughShare() const;  // of transmission()
  const Spectrum& transmission() const { return transmission_; }
  // Of a pane: sampleMirror()'s transmission without its probability and colour.
  float transmittance() const { return fresnel(wo_.z).base; }

 private:
  // A microfacet that connects two directions, in the frame of the distribution.
  struct Facet {
    Vec3 o, i, h;
    Fresnel fresnel;
  };

  bool has(uint32_t lobe) const { return (lobes_ & lobe) != 0; }
  void initFresnel(const SurfaceParameters& p);
  void initDistribution(const SurfaceParameters& p);
  void initMeanAlbedo();
  void initMultiScatter(const SurfaceParameters& p, Transport transport);

  Fresnel fresnel(float cosine) const;
  Fresnel fresnelGeneral(float cosine) const;
  float reflectProbability(const Fresnel& f) const;
  Spectrum reflectance(const Facet& facet) const;
  float metalFactor(float cosine) const;
  float glassFactor(float cosineI) const;
  float dielectricAlbedo(const GgxAlbedo& e) const { return std::min(baseF0_ * e.f0 + baseF90_ * e.f90, 1.0f); }
  float dielectricAlbedo(int side, float cosine) const;
  Vec3 toGgx(const Vec3& w) const;
  Vec3 fromGgx(const Vec3& w) const;
  void addReflection(const Facet& facet, float probability, BsdfValue& v) const;
  void addTransmission(const Facet& facet, float probability, BsdfValue& v) const;
  Vec3 refractSmooth() const;

  uint32_t lobes_;   // those of kLobes, and their modifiers
  bool general_;     // the Fresnel term is no plain Schlick curve
  bool refractive_;  // a solid with a refractive index: Snell's law applies
  bool smooth_, straight_, passThrough_;
  bool weighsDiffuse_;  // diffuse lobes lie below
  bool entering_;

  Vec3 wo_;
  Spectrum transmission_;  // colour with its share of the mix

  // Schlick end points of dielectric and metal mixed, and of the dielectric's maximum alone.
  Spectrum f0_;
  float f90_, baseF0_, baseF90_;
  Ggx ggx_;
  Vec2 tangent_;
  float stretchO_;
  float eta_;            // index on the other side over index on the side of wo
  float radianceScale_;  // 1/eta²
  float transmissionScale_;
  TableRow row_, rowAcross_;

  // For kLobeMultiScatter only.
  TableRow metalRow_, metalRowAcross_;
  Spectrum metalScatter_;    // metallic_ times metalScatterColour()
  float metalO_;             // the factor of wo
  GlassPlace glass_;         // where transmissionShare_ > 0
  float transmissionShare_;  // of the dielectric
  float glassO_;             // the factor of wo
  bool fromLight_;           // wi is on the camera's side

  // For general_ only.
  Spectrum dielectricF0_, metalF0_;
  float weight_, metallic_, iridescence_;
  ThinFilm film_;

  // Albedo of the dielectric seen from either side (0: that of wo), for weighsDiffuse_.
  std::array<std::array<float, kFresnelNodes>, 2> curve_;
  float meanAlbedo_[2];
  float belowO_;       // 1 - E(wo)
  GgxAlbedo albedoO_;  // for wo
};

}  // namespace braid
