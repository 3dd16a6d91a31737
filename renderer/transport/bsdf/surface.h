// SPDX-License-Identifier: Apache-2.0
// A material evaluated at one point: textures looked up, factors multiplied. The BSDF is built from this alone.
#pragma once

#include <cstdint>

#include "renderer/core/vec.h"

namespace braid {

// Which lobes a surface has. Anything not set is left out: no sampling, no evaluation, and its parameters may stay
// uninitialised.
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
};

struct SurfaceParameters {
  uint32_t lobes = kLobeDiffuse;
  Spectrum baseColor{0.5f};
  float metallic = 0;
  float roughness = 1;  // perceptual, [0,1]

  float etaInside = 1.5f;   // refractive index of the material (KHR_materials_ior); 0: F = 1
  float etaOutside = 1.0f;  // of the medium around it
  bool entering = true;     // wo lies on the front side (outside) of the surface
  bool thinWalled = true;

  float specular = 1;
  Spectrum specularColor{1};
  Spectrum specularF0{0};  // only with kLobeSpecularGlossiness

  float transmission = 0;
  float diffuseTransmission = 0;
  Spectrum diffuseTransmissionColor{1};

  float clearcoat = 0;
  float clearcoatRoughness = 0;
  Vec3 clearcoatNormal{0, 0, 1};  // in the local shading frame

  Spectrum sheenColor{0};
  float sheenRoughness = 0;

  float anisotropy = 0;
  Vec2 anisotropyDirection{1, 0};  // unit, in the local tangent plane

  float iridescence = 0;
  float iridescenceIor = 1.3f;
  float iridescenceThickness = 400;  // nanometres
};

}  // namespace braid
