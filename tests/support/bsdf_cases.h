// SPDX-License-Identifier: Apache-2.0
// Materials for the BSDF tests: each lobe alone and the mixtures that occur; how they look from the other side.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "renderer/transport/bsdf/bsdf.h"
#include "renderer/transport/bsdf/surface.h"

namespace braid::test {

struct BsdfCase {
  std::string name;
  SurfaceParameters p;
};

inline SurfaceParameters lambert(const Spectrum& color = Spectrum(0.8f, 0.5f, 0.2f)) {
  SurfaceParameters p;
  p.baseColor = color;
  return p;
}

inline SurfaceParameters plastic(float roughness, const Spectrum& color = Spectrum(0.8f, 0.5f, 0.2f)) {
  SurfaceParameters p = lambert(color);
  p.lobes = kLobeDiffuse | kLobeSpecular;
  p.roughness = roughness;
  return p;
}

inline SurfaceParameters metal(float roughness, float metallic = 1) {
  SurfaceParameters p = plastic(roughness, Spectrum(1.0f, 0.78f, 0.34f));
  p.metallic = metallic;
  return p;
}

inline SurfaceParameters glass(float roughness, bool entering, float ior = 1.5f, float transmission = 1) {
  SurfaceParameters p = plastic(roughness, Spectrum(0.9f, 0.95f, 1.0f));
  p.lobes |= kLobeTransmission;
  p.transmission = transmission;
  p.thinWalled = false;
  p.entering = entering;
  p.etaInside = ior;
  return p;
}

inline SurfaceParameters thinGlass(float roughness, float transmission = 1) {
  SurfaceParameters p = glass(roughness, true, 1.5f, transmission);
  p.thinWalled = true;
  return p;
}

inline SurfaceParameters withClearcoat(SurfaceParameters p, float roughness, float amount = 1,
                                       const Vec3& normal = Vec3(0, 0, 1)) {
  p.lobes |= kLobeClearcoat;
  p.clearcoat = amount;
  p.clearcoatRoughness = roughness;
  p.clearcoatNormal = glm::normalize(normal);
  return p;
}

inline SurfaceParameters withSheen(SurfaceParameters p, float roughness,
                                   const Spectrum& color = Spectrum(1, 0.8f, 0.6f)) {
  p.lobes |= kLobeSheen;
  p.sheenColor = color;
  p.sheenRoughness = roughness;
  return p;
}

inline SurfaceParameters withAnisotropy(SurfaceParameters p, float strength, float angle) {
  p.lobes |= kLobeAnisotropy;
  p.anisotropy = strength;
  p.anisotropyDirection = Vec2(std::cos(angle), std::sin(angle));
  return p;
}

inline SurfaceParameters withFilm(SurfaceParameters p, float thickness, float ior = 1.3f, float amount = 1) {
  p.lobes |= kLobeIridescence;
  p.iridescence = amount;
  p.iridescenceIor = ior;
  p.iridescenceThickness = thickness;
  return p;
}

inline SurfaceParameters withMultiScatter(SurfaceParameters p) {
  p.lobes |= kLobeMultiScatter;
  return p;
}

inline SurfaceParameters withDiffuseTransmission(SurfaceParameters p, float amount) {
  p.lobes |= kLobeDiffuseTransmission;
  p.diffuseTransmission = amount;
  p.diffuseTransmissionColor = Spectrum(0.3f, 0.9f, 0.4f);
  return p;
}

inline SurfaceParameters specularGlossiness() {
  SurfaceParameters p = plastic(0.4f);
  p.lobes |= kLobeSpecularGlossiness;
  p.specularF0 = Spectrum(0.5f, 0.3f, 0.2f);
  return p;
}

inline SurfaceParameters tintedSpecular() {
  SurfaceParameters p = plastic(0.3f);
  p.specular = 0.7f;
  p.specularColor = Spectrum(4, 1, 0.2f);
  p.etaInside = 2;
  return p;
}

inline std::vector<BsdfCase> bsdfCases() {
  std::vector<BsdfCase> cases = {{"diffuse", lambert()},
                                 {"leaf", withDiffuseTransmission(lambert(), 0.4f)},
                                 {"leaf with gloss", withDiffuseTransmission(plastic(0.4f), 0.6f)}};
  for (const float r : {0.05f, 0.2f, 0.5f, 1.0f}) {
    const std::string at = " " + std::to_string(r).substr(0, 4);
    cases.push_back({"metal" + at, metal(r)});
    cases.push_back({"plastic" + at, plastic(r)});
    cases.push_back({"glass entering" + at, glass(r, true)});
    cases.push_back({"glass leaving" + at, glass(r, false)});
    cases.push_back({"thin glass" + at, thinGlass(r)});
    cases.push_back({"sheen" + at, withSheen(lambert(Spectrum(0)), r)});
    cases.push_back({"clearcoat" + at, withClearcoat(lambert(Spectrum(0)), r)});
    if (r < 0.1f) continue;
    cases.push_back({"multi-scatter metal" + at, withMultiScatter(metal(r))});
    cases.push_back({"multi-scatter glass entering" + at, withMultiScatter(glass(r, true))});
    cases.push_back({"multi-scatter glass leaving" + at, withMultiScatter(glass(r, false))});
    cases.push_back({"multi-scatter thin glass" + at, withMultiScatter(thinGlass(r))});
  }
  cases.push_back({"multi-scatter half metal", withMultiScatter(metal(0.7f, 0.5f))});
  cases.push_back({"multi-scatter milky glass", withMultiScatter(glass(0.6f, true, 1.5f, 0.5f))});
  cases.push_back({"multi-scatter brushed metal", withMultiScatter(withAnisotropy(metal(0.4f), 0.6f, 0.7f))});
  cases.push_back({"multi-scatter oil on metal", withMultiScatter(withFilm(metal(0.6f), 800, 1.8f))});
  cases.push_back({"half metal", metal(0.3f, 0.5f)});
  cases.push_back({"dense glass leaving", glass(0.3f, false, 2.4f)});
  cases.push_back({"milky glass entering", glass(0.3f, true, 1.5f, 0.5f)});
  cases.push_back({"milky glass leaving", glass(0.3f, false, 1.5f, 0.5f)});
  cases.push_back({"index matched rough glass", glass(0.5f, true, 1.0f)});
  cases.push_back({"thin glass with diffuse part", withDiffuseTransmission(thinGlass(0.4f, 0.5f), 0.5f)});
  cases.push_back({"brushed metal", withAnisotropy(metal(0.2f), 0.8f, 0.7f)});
  cases.push_back({"brushed plastic", withAnisotropy(plastic(0.1f), 1.0f, -0.4f)});
  cases.push_back({"brushed glass", withAnisotropy(glass(0.2f, true), 0.7f, 0.3f)});
  cases.push_back({"soap on plastic", withFilm(plastic(0.3f), 400)});
  cases.push_back({"oil on metal", withFilm(metal(0.3f), 800, 1.8f)});
  cases.push_back({"film on glass leaving", withFilm(glass(0.2f, false), 300)});
  cases.push_back({"car paint", withClearcoat(metal(0.5f, 0.6f), 0.0f)});
  cases.push_back({"tilted coat", withClearcoat(plastic(0.6f), 0.2f, 0.8f, Vec3(0.3f, -0.2f, 1))});
  cases.push_back({"coated glass entering", withClearcoat(glass(0.2f, true), 0.3f)});
  cases.push_back({"coated glass leaving", withClearcoat(glass(0.2f, false), 0.3f)});
  cases.push_back({"velvet", withSheen(plastic(0.8f), 0.3f)});
  cases.push_back(
      {"everything",
       withClearcoat(withSheen(withFilm(withAnisotropy(metal(0.4f, 0.3f), 0.5f, 1), 500), 0.5f), 0.15f, 0.7f)});
  cases.push_back({"specular-glossiness", specularGlossiness()});
  cases.push_back({"tinted specular", tintedSpecular()});
  return cases;
}

// Directions toward the viewer from normal to grazing.
inline std::vector<Vec3> viewDirections() {
  std::vector<Vec3> result;
  for (const float z : {0.999f, 0.7f, 0.25f, 0.03f}) {
    const float r = std::sqrt(1 - z * z), phi = 0.5f + 3 * z;
    result.push_back(Vec3(r * std::cos(phi), r * std::sin(phi), z));
  }
  return result;
}

inline Vec3 mirrored(const Vec3& w) { return Vec3(w.x, w.y, -w.z); }

inline bool usable(const Spectrum& s) { return isFinite(s) && minComponent(s) >= 0; }

// Difference in units of the larger.
inline double relative(double a, double b) { return std::fabs(a - b) / std::max({std::fabs(a), std::fabs(b), 1e-6}); }

// The material as seen from wi when it transmits wo: the roles of both sides exchanged.
inline SurfaceParameters otherSide(SurfaceParameters p) {
  p.entering = !p.entering;
  p.clearcoatNormal = Vec3(-p.clearcoatNormal.x, -p.clearcoatNormal.y, p.clearcoatNormal.z);
  return p;
}

inline Bsdf exchanged(const SurfaceParameters& p, const Vec3& wi, Transport transport = Transport::Radiance) {
  return wi.z > 0 ? Bsdf(p, wi, transport) : Bsdf(otherSide(p), mirrored(wi), transport);
}

}  // namespace braid::test
