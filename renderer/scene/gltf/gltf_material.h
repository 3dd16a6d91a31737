// SPDX-License-Identifier: Apache-2.0
// Which materials and textures the kept part of a file needs, and the uv slots their meshes must fill.
#pragma once

#include <array>
#include <map>
#include <utility>
#include <vector>

#include "renderer/scene/gltf/document/gltf_document.h"
#include "renderer/scene/gltf/gltf_images.h"

namespace braid::gltf {

// The materials of the kept primitives, in order of first use, with compacted texture and uv indices.
class MaterialTable {
 public:
  // What a tangent frame follows: a uv set of the file, and the linear part of a texture's transform, row-major.
  struct TangentSource {
    uint32_t set = 0;
    std::array<float, 4> linear{1, 0, 0, 1};
    bool operator==(const TangentSource&) const = default;
  };
  struct Uvs {
    std::array<uint32_t, kUvSlots> set{kNone, kNone, kNone, kNone};  // the file's uv set behind each slot
    std::vector<TangentSource> tangents;  // of the frames that the material reads, at least one
  };

  MaterialTable(Document& document, SceneData& scene, bool doubleSided)
      : document_(document), scene_(scene), doubleSided_(doubleSided), placed_(document.materials.size() + 1, kNone) {}

  // The index into SceneData::materials for a material of the file; -1 is the default material.
  uint32_t use(int fileMaterial);
  const Uvs& uvs(uint32_t material) const { return uvs_[material]; }
  // Decodes the images of all used textures in parallel and fills SceneData::textures.
  void loadTextures();

 private:
  Uvs assignUvSlots(Material& material, int fileMaterial);
  std::shared_ptr<const Image> pixels(const DecodedImage& decoded, int fileTexture, bool isColour, bool isNormal);
  void dropMissingTextures();

  Document& document_;
  SceneData& scene_;
  bool doubleSided_;
  std::vector<uint32_t> placed_;
  std::vector<Uvs> uvs_;
  std::map<std::pair<int32_t, bool>, int32_t> textures_;  // file texture and isColour to the scene's texture
};

}  // namespace braid::gltf
