// SPDX-License-Identifier: Apache-2.0
// glTF metallic-roughness material with its extensions, as plain data. Factors are linear; textures multiply factors.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>

#include "renderer/core/vec.h"
#include "renderer/scene/data/textures/texture.h"

namespace braid {

enum class AlphaMode : uint8_t { Opaque, Mask, Blend };

// GGX alpha below which a surface is taken for smooth: a mirror, or a clear pane.
inline constexpr float kSmoothAlpha = 1e-3f;

inline constexpr float kLargestIor = 100;

struct Material {
  std::string name;

  Spectrum baseColor{1};
  float alpha = 1;
  TextureRef baseColorTexture;  // RGB colour (sRGB), A coverage
  float metallic = 1;
  float roughness = 1;                  // perceptual: GGX alpha = roughness²
  TextureRef metallicRoughnessTexture;  // G roughness, B metallic

  // KHR_materials_pbrSpecularGlossiness: baseColor holds the diffuse factor, roughness = 1 - glossiness.
  bool specularGlossiness = false;
  Spectrum specularF0{1};
  TextureRef specularGlossinessTexture;  // RGB specular F0 (sRGB), A glossiness

  TextureRef normalTexture;
  float normalScale = 1;

  Spectrum emission{0};  // emissiveFactor · emissiveStrength, W·sr⁻¹·m⁻²
  TextureRef emissiveTexture;

  bool isGround = false;  // addGround()
  AlphaMode alphaMode = AlphaMode::Opaque;
  float alphaCutoff = 0.5f;
  bool doubleSided = false;
  bool unlit = false;

  float ior = 1.5f;      // 0 is legal: F = 1 (KHR_materials_ior)
  float dispersion = 0;  // 20 / Abbe number

  float specular = 1;          // KHR_materials_specular
  TextureRef specularTexture;  // A
  Spectrum specularColor{1};
  TextureRef specularColorTexture;  // RGB (sRGB)

  float transmission = 0;
  TextureRef transmissionTexture;  // R
  bool thinWalled = true;          // thicknessFactor == 0: an infinitely thin sheet, no volume
  Spectrum attenuationColor{1};
  float attenuationDistance = kInfinity;  // metres

  // KHR_materials_volume_scatter
  Spectrum scatterAlbedo{0};    // of a single event: the part of the attenuation that only turns light
  float scatterAnisotropy = 0;  // mean cosine g of Henyey and Greenstein, in (-1, 1)
  Spectrum extinction{0};       // per metre, of a medium that scatters; Scene works it out

  float diffuseTransmission = 0;
  TextureRef diffuseTransmissionTexture;  // A
  Spectrum diffuseTransmissionColor{1};
  TextureRef diffuseTransmissionColorTexture;  // RGB (sRGB)

  float clearcoat = 0;
  TextureRef clearcoatTexture;  // R
  float clearcoatRoughness = 0;
  TextureRef clearcoatRoughnessTexture;  // G
  TextureRef clearcoatNormalTexture;
  float clearcoatNormalScale = 1;
  uint8_t coatFrame = 0;  // which tangents of the mesh belong to the texture: 0 `tangents`, else `otherTangents`

  Spectrum sheenColor{0};
  TextureRef sheenColorTexture;  // RGB (sRGB)
  float sheenRoughness = 0;
  TextureRef sheenRoughnessTexture;  // A

  float anisotropy = 0;
  float anisotropyRotation = 0;  // radians, counter-clockwise from the tangent
  TextureRef anisotropyTexture;  // RG direction, B strength
  uint8_t anisotropyFrame = 0;   // as coatFrame

  float iridescence = 0;
  TextureRef iridescenceTexture;  // R
  float iridescenceIor = 1.3f;
  float iridescenceThicknessMin = 100;  // nanometres
  float iridescenceThicknessMax = 400;
  TextureRef iridescenceThicknessTexture;  // G

  bool multiScatter = true;  // light that leaves a rough surface after several microfacets is not lost

  bool emissive() const { return maxComponent(emission) > 0; }
  bool transmissive() const { return transmission > 0; }
  bool hasVolume() const { return !thinWalled && (transmissive() || diffuseTransmission > 0); }
  bool scatters() const {
    return hasVolume() && !isBlack(scatterAlbedo) && attenuationDistance < kInfinity && attenuationColor != Spectrum(1);
  }
  bool disperses() const { return dispersion > 0 && ior > 1 && !thinWalled && transmissive() && !specularGlossiness; }
  // Refractive index of a colour channel, by the formula of KHR_materials_dispersion for its lines C (656.3 nm, red),
  // d (587.6 nm, green) and F (486.1 nm, blue). Without a channel (3), that of the line d.
  float indexOf(unsigned channel) const {
    constexpr std::array<float, 3> kSlope = {523655 / (656.3f * 656.3f) - 1.5168f, 0,
                                             523655 / (486.1f * 486.1f) - 1.5168f};
    if (channel >= kSlope.size() || !disperses()) return ior;
    return std::clamp(ior + (ior - 1) * (dispersion / 20) * kSlope[channel], 1.0f, kLargestIor);
  }
  // Whether light may go straight on through it somewhere: transmissive, thin, smooth.
  bool mayBePane() const {
    return transmissive() && thinWalled && !unlit && !specularGlossiness &&
           (metallicRoughnessTexture || (metallic < 1 && roughness * roughness < kSmoothAlpha));
  }
  // Whether single scattering would lose light somewhere: on rough metals and rough transmissive dielectrics.
  bool losesToRoughness() const {
    return !unlit && !specularGlossiness && (metallic > 0 || transmissive()) && roughness * roughness >= kSmoothAlpha;
  }
  bool mayBeDielectric() const { return metallic < 1 || metallicRoughnessTexture; }
  // Whether something is left somewhere for the lobes below the specular ones.
  bool mayBeDiffuse() const { return mayBeDielectric() && (transmission < 1 || transmissionTexture); }
  // Tangents are needed by normal maps and by anisotropy.
  bool needsTangents() const { return normalTexture || clearcoatNormalTexture || anisotropy != 0; }
};

// Calls visit(reference, isColour, isRead) for each texture of a material. Colours are stored in sRGB; what a factor of
// exactly zero switches off reads no texture.
template <class MaterialType, class Visit>
void forEachTexture(MaterialType& m, const Visit& visit) {
  visit(m.baseColorTexture, true, true);
  visit(m.specularGlossinessTexture, true, true);
  visit(m.emissiveTexture, true, !isBlack(m.emission));
  visit(m.specularColorTexture, true, m.specular != 0);
  visit(m.diffuseTransmissionColorTexture, true, m.diffuseTransmission != 0);
  visit(m.sheenColorTexture, true, !isBlack(m.sheenColor));
  visit(m.metallicRoughnessTexture, false, true);
  visit(m.normalTexture, false, true);
  visit(m.specularTexture, false, m.specular != 0);
  visit(m.transmissionTexture, false, m.transmission != 0);
  visit(m.diffuseTransmissionTexture, false, m.diffuseTransmission != 0);
  visit(m.clearcoatTexture, false, m.clearcoat != 0);
  visit(m.clearcoatRoughnessTexture, false, m.clearcoat != 0);
  visit(m.clearcoatNormalTexture, false, m.clearcoat != 0);
  visit(m.sheenRoughnessTexture, false, !isBlack(m.sheenColor));
  visit(m.anisotropyTexture, false, m.anisotropy != 0);
  visit(m.iridescenceTexture, false, m.iridescence != 0);
  visit(m.iridescenceThicknessTexture, false, m.iridescence != 0);
}

}  // namespace braid
