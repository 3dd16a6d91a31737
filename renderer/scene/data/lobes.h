// SPDX-License-Identifier: Apache-2.0
// The lobes of the material model as one table: which materials have them, and what reports call them.
#pragma once

#include <cstdint>

#include "renderer/scene/data/material.h"

namespace braid {

// Anything not set is left out: no sampling, no evaluation, and its parameters may stay uninitialised.
enum LobeFlags : uint32_t {
  kLobeDiffuse = 1u << 0,  // Lambertian reflection (1 - metallic)(1 - transmission)(1 - diffuseTransmission)
  kLobeDiffuseTransmission = 1u << 1,  // Lambertian transmission
  kLobeSpecular = 1u << 2,             // GGX reflection, dielectric and metal
  kLobeTransmission = 1u << 3,         // GGX refraction, or straight-through when thin-walled
  kLobeClearcoat = 1u << 4,
  kLobeSheen = 1u << 5,
  kLobeIridescence = 1u << 6,         // modifies the specular Fresnel term
  kLobeAnisotropy = 1u << 7,          // modifies the specular distribution
  kLobeSpecularGlossiness = 1u << 8,  // dielectric F0 given directly (specularF0), metallic is 0
  kLobeMultiScatter = 1u << 9,        // modifies the rough specular lobe: it keeps what single scattering loses
};

// A surface with one of these is lit from both sides.
inline constexpr uint32_t kTransmittingLobes = kLobeTransmission | kLobeDiffuseTransmission;

struct LobeEntry {
  LobeFlags lobe;
  bool (*on)(const Material&);  // whether a material has it somewhere
  const char* trait;            // null: every scene has it, and no report names it
  // Of the plan: the part, why it is kept, why it is left out.
  const char *part, *kept, *left;
};

inline constexpr LobeEntry kLobeTable[] = {
    {kLobeDiffuse,
     [](const Material& m) {
       return m.specularGlossiness || (m.mayBeDiffuse() && (m.diffuseTransmission < 1 || m.diffuseTransmissionTexture));
     },
     nullptr, nullptr, nullptr, nullptr},
    {kLobeSpecularGlossiness, [](const Material& m) { return m.specularGlossiness; }, nullptr, nullptr, nullptr,
     nullptr},
    // Transmission shares the microfacets of the reflection, which total reflection needs even where specular is 0.
    {kLobeSpecular,
     [](const Material& m) { return m.specularGlossiness || m.metallic > 0 || m.specular > 0 || m.transmission > 0; },
     "specular", "specular lobe", "materials reflect specularly", "every material is perfectly diffuse"},
    {kLobeTransmission, [](const Material& m) { return m.mayBeDielectric() && m.transmission > 0; }, "transmission",
     "transmission lobe", "transmissive materials", "no material transmits light"},
    {kLobeDiffuseTransmission, [](const Material& m) { return m.mayBeDiffuse() && m.diffuseTransmission > 0; },
     "diffuse-transmission", "diffuse transmission lobe", "diffusely transmissive materials",
     "no material transmits light diffusely"},
    {kLobeClearcoat, [](const Material& m) { return m.clearcoat > 0; }, "clearcoat", "clearcoat lobe",
     "clearcoat materials", "no clearcoat"},
    {kLobeSheen, [](const Material& m) { return maxComponent(m.sheenColor) > 0; }, "sheen", "sheen lobe",
     "sheen materials", "no sheen"},
    {kLobeIridescence, [](const Material& m) { return m.iridescence > 0; }, "iridescence", "iridescence", "thin films",
     "no thin film"},
    {kLobeAnisotropy, [](const Material& m) { return m.anisotropy != 0; }, "anisotropy", "anisotropy",
     "anisotropic materials", "no anisotropic material"},
    {kLobeMultiScatter, [](const Material& m) { return m.multiScatter && m.losesToRoughness(); }, "multi-scatter",
     "multi-scatter", "rough metals and glass keep what single scattering loses", "no rough metal and no rough glass"},
};

// All lobes that a material can have anywhere on a surface.
inline uint32_t materialLobes(const Material& material) {
  uint32_t lobes = 0;
  for (const LobeEntry& entry : kLobeTable)
    if (entry.on(material)) lobes |= entry.lobe;
  // KHR_materials_pbrSpecularGlossiness is a model of its own, which no other extension adds to.
  return material.specularGlossiness ? lobes & (kLobeDiffuse | kLobeSpecular | kLobeSpecularGlossiness) : lobes;
}

}  // namespace braid
