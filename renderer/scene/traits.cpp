// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/traits.h"

#include <algorithm>
#include <iterator>

#include "renderer/scene/data/lobes.h"
#include "renderer/scene/file_parts.h"
#include "renderer/scene/scene.h"

namespace braid {

std::vector<std::string> SceneTraits::names() const {
  static const char* kNames[] = {"textures",
                                 "normal-maps",
                                 "alpha-mask",
                                 "alpha-blend",
                                 "culled-faces",
                                 "volume",
                                 "vertex-colors",
                                 "texture-transforms",
                                 "instances",
                                 "emissive-triangles",
                                 "point-lights",
                                 "directional-lights",
                                 "environment",
                                 "environment-image",
                                 "smooth-specular",
                                 "unlit",
                                 "panes",
                                 "dispersion",
                                 "volume-scattering"};
  std::vector<std::string> list;
  for (size_t i = 0; i < std::size(kNames); ++i)
    if (has(1u << i)) list.push_back(kNames[i]);
  for (const LobeEntry& entry : kLobeTable)
    if (entry.trait && hasLobe(entry.lobe)) list.push_back(entry.trait);
  for (size_t i = 0; i < kFileParts; ++i)
    if (parts[i] > 0) list.push_back(kFilePartTable[i].trait);
  return list;
}

namespace {

uint32_t materialFlags(const Material& m) {
  uint32_t flags = 0;
  forEachTexture(m, [&](const TextureRef& ref, bool, bool) {
    if (!ref) return;
    flags |= kTraitTextures;
    if (ref.transformed) flags |= kTraitTextureTransforms;
  });
  if (m.normalTexture || m.clearcoatNormalTexture) flags |= kTraitNormalMaps;
  if (m.unlit) return flags | kTraitUnlit;
  if (m.mayBePane()) flags |= kTraitPanes;
  if (m.hasVolume()) flags |= kTraitVolume;
  if (m.disperses()) flags |= kTraitDispersion;
  if (m.scatters()) flags |= kTraitScattering;
  const bool smoothBase = m.roughness < 0.1f || (m.metallicRoughnessTexture && m.roughness > 0);
  if (((m.metallic > 0 || m.transmission > 0 || m.specularGlossiness) && smoothBase) ||
      (m.clearcoat > 0 && m.clearcoatRoughness < 0.1f))
    flags |= kTraitSmoothSpecular;
  return flags;
}

}  // namespace

void Scene::detectTraits() {
  SceneTraits& t = traits_;
  t.parts = data_.parts;
  std::vector<uint64_t> groupTriangles(groups_.size(), 0);
  const auto addMesh = [&](uint32_t m) {
    const TriangleMesh& mesh = data_.meshes[m];
    const Material& mat = material(mesh);
    t.triangles += mesh.triangles.size();
    t.flags |= materialFlags(mat);
    if (!mat.unlit) t.lobes |= materialLobes(mat);
    if (!mesh.colors.empty()) t.flags |= kTraitVertexColors;
    if (mat.alphaMode == AlphaMode::Mask) t.flags |= kTraitAlphaMask;
    if (mat.alphaMode == AlphaMode::Blend) t.flags |= kTraitAlphaBlend;
    if (filtered_[m] && mat.alphaMode == AlphaMode::Opaque && !mat.doubleSided) t.flags |= kTraitCulledFaces;
    ++t.meshes;
  };
  for (uint32_t m : worldMeshes_) {
    addMesh(m);
    t.instancedTriangles += data_.meshes[m].triangles.size();
  }
  for (size_t g = 0; g < groups_.size(); ++g)
    for (uint32_t m : groups_[g].meshes) {
      addMesh(m);
      groupTriangles[g] += data_.meshes[m].triangles.size();
    }
  for (const GroupInstance& i : instances_) t.instancedTriangles += groupTriangles[i.group];
  t.instances = instances_.size();
  if (!instances_.empty()) t.flags |= kTraitInstances;
  t.materials = data_.materials.size();
  t.textures = data_.textures.size();

  t.emissiveTriangles = emitters_.size();
  if (!emitters_.empty()) t.flags |= kTraitEmissiveTriangles;
  float smallest = kInfinity;
  for (const EmissiveTriangle& e : emitters_)
    if (e.area > 0) smallest = std::min(smallest, e.area);
  t.smallestEmitterArea = smallest < kInfinity ? smallest : 0;
  t.punctualLights = data_.lights.size();
  for (const PunctualLight& light : data_.lights)
    t.flags |= light.kind == PunctualKind::Directional ? kTraitDirectionalLights : kTraitPointLights;
  if (environment_)
    t.flags |= environment_->constant() ? kTraitEnvironment : kTraitEnvironment | kTraitEnvironmentImage;

  t.centre = bounds_.empty() ? Vec3(0) : bounds_.centre();
  t.radius =
      bounds_.empty() ? 1.0f : std::max(0.5f * glm::length(bounds_.diagonal()), std::numeric_limits<float>::min());
}

}  // namespace braid
