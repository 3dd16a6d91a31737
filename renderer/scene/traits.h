// SPDX-License-Identifier: Apache-2.0
// What a scene contains, as numbers and flags: the Plan decides from these what may be left out.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/scene/data/scene_data.h"

namespace braid {

enum TraitFlags : uint32_t {
  kTraitTextures = 1u << 0,
  kTraitNormalMaps = 1u << 1,
  kTraitAlphaMask = 1u << 2,
  kTraitAlphaBlend = 1u << 3,
  kTraitCulledFaces = 1u << 4,  // single-sided open surfaces
  kTraitVolume = 1u << 5,       // attenuation or refraction inside closed solids
  kTraitVertexColors = 1u << 6,
  kTraitTextureTransforms = 1u << 7,
  kTraitInstances = 1u << 8,
  kTraitEmissiveTriangles = 1u << 9,
  kTraitPointLights = 1u << 10,  // point and spot
  kTraitDirectionalLights = 1u << 11,
  kTraitEnvironment = 1u << 12,
  kTraitEnvironmentImage = 1u << 13,
  kTraitSmoothSpecular = 1u << 14,  // roughness < 0.1 on a metal, clearcoat or transmissive surface: may cast caustics
  kTraitUnlit = 1u << 15,
  kTraitPanes = 1u << 16,       // light may go straight on through a surface: Material::mayBePane()
  kTraitDispersion = 1u << 17,  // Material::disperses()
  kTraitScattering = 1u << 18,  // Material::scatters()
};

struct SceneTraits {
  uint32_t flags = 0;  // TraitFlags
  uint32_t lobes = 0;  // LobeFlags, of all materials
  uint64_t triangles = 0, instancedTriangles = 0;
  uint64_t emissiveTriangles = 0;
  uint64_t punctualLights = 0;
  uint64_t instances = 0, meshes = 0, materials = 0, textures = 0;
  FilePartCounts parts{};         // what the file held
  float smallestEmitterArea = 0;  // m², 0 when none
  Vec3 centre{0};                 // bounding sphere of the scene, metres
  float radius = 0;

  bool has(uint32_t flag) const { return (flags & flag) != 0; }
  bool hasLobe(uint32_t lobe) const { return (lobes & lobe) != 0; }
  // The names of the set flags and lobes, and of what the file held.
  std::vector<std::string> names() const;
};

}  // namespace braid
