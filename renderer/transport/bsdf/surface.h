// SPDX-License-Identifier: Apache-2.0
// A material evaluated at one point: textures looked up, factors multiplied. The BSDF is built from this alone.
#pragma once

#include <cstdint>

#include "renderer/core/vec.h"
#include "renderer/scene/data/lobes.h"
#include "renderer/transport/bsdf/covers.h"

namespace braid {

struct SurfaceParameters : Covers::Parameters {
  uint32_t lobes = kLobeDiffuse;  // LobeFlags
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

  float anisotropy = 0;
  Vec2 anisotropyDirection{1, 0};  // unit, in the local tangent plane

  float iridescence = 0;
  float iridescenceIor = 1.3f;
  float iridescenceThickness = 400;  // nanometres

  float metalShare() const { return (lobes & kLobeSpecular) && !(lobes & kLobeSpecularGlossiness) ? metallic : 0.0f; }
  float transmissionShare() const { return lobes & kLobeTransmission ? transmission : 0.0f; }
};

}  // namespace braid
