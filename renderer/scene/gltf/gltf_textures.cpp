// SPDX-License-Identifier: Apache-2.0
// Kept materials: uv slots, texture indices, and the textures they read.
#include <algorithm>
#include <set>

#include "renderer/scene/gltf/gltf_material.h"

namespace braid::gltf {

namespace {

using TangentSource = MaterialTable::TangentSource;

TangentSource tangentSource(const TextureRef& ref) {
  TangentSource source{ref.uvSet, {ref.matrix[0], ref.matrix[1], ref.matrix[3], ref.matrix[4]}};
  // Stretching turns no tangent.
  const std::array<float, 4>& l = source.linear;
  if (l[0] > 0 && l[1] == 0 && l[2] == 0 && l[3] > 0) source.linear = {1, 0, 0, 1};
  return source;
}

// One frame for each way in which the textures that read tangents lie, that of the normal map first. Anisotropy without
// a texture follows the coordinates as they are.
std::vector<TangentSource> tangentSources(Material& m) {
  std::vector<TangentSource> sources;
  const auto frameOf = [&](const TangentSource& source) {
    const auto found = std::find(sources.begin(), sources.end(), source);
    const auto frame = static_cast<uint8_t>(found - sources.begin());
    if (found == sources.end()) sources.push_back(source);
    return frame;
  };
  uint32_t set = 0;
  for (const TextureRef* ref : {&m.anisotropyTexture, &m.clearcoatNormalTexture, &m.normalTexture}) {
    if (*ref) set = ref->uvSet;
  }
  if (m.normalTexture) frameOf(tangentSource(m.normalTexture));
  if (m.clearcoatNormalTexture) m.coatFrame = frameOf(tangentSource(m.clearcoatNormalTexture));
  if (m.anisotropyTexture) {
    m.anisotropyFrame = frameOf(tangentSource(m.anisotropyTexture));
  } else if (m.anisotropy != 0 || sources.empty()) {
    m.anisotropyFrame = frameOf({set, {1, 0, 0, 1}});
  }
  return sources;
}

Wrap wrapOf(int mode) {
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::Clamp;
  return mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? Wrap::Mirror : Wrap::Repeat;
}

// The textures of lobes that are switched off need not be read.
void dropUnreadTextures(Material& m) {
  forEachTexture(m, [](TextureRef& ref, bool, bool isRead) {
    if (!isRead) ref = {};
  });
}

}  // namespace

MaterialTable::Uvs MaterialTable::assignUvSlots(Material& material, int fileMaterial) {
  std::set<uint32_t> sets;
  forEachTexture(material, [&](const TextureRef& ref, bool, bool) {
    if (ref) sets.insert(ref.uvSet);
  });
  Uvs uvs;
  uvs.tangents = tangentSources(material);
  if (sets.size() > kUvSlots) {
    document_.report.warn(
        "/materials/" + std::to_string(fileMaterial),
        "a material reads more than " + std::to_string(kUvSlots) + " uv sets; the others read the first");
  }
  if (sets.empty() || *sets.rbegin() < kUvSlots) {
    for (const uint32_t set : sets) uvs.set[set] = set;
    return uvs;
  }
  size_t slot = 0;
  for (const uint32_t set : sets) {
    if (slot < kUvSlots) uvs.set[slot++] = set;
  }
  forEachTexture(material, [&](TextureRef& ref, bool, bool) {
    const auto found = std::find(uvs.set.begin(), uvs.set.end(), ref.uvSet);
    ref.uvSet = static_cast<uint8_t>(found == uvs.set.end() ? 0 : found - uvs.set.begin());
  });
  return uvs;
}

uint32_t MaterialTable::use(int fileMaterial) {
  uint32_t& placed = placed_[fileMaterial < 0 ? placed_.size() - 1 : static_cast<size_t>(fileMaterial)];
  if (placed != kNone) return placed;
  placed = static_cast<uint32_t>(scene_.materials.size());
  Material material;
  if (fileMaterial < 0) {
    material.name = "default";
  } else {
    material = document_.materials[static_cast<size_t>(fileMaterial)];
    document_.usage.mark("materials", fileMaterial);
  }
  material.doubleSided |= doubleSided_;
  material.multiScatter = document_.options.multiScatter;
  dropUnreadTextures(material);
  forEachTexture(material, [&](TextureRef& ref, bool, bool) {
    if (!ref) return;
    const tinygltf::Texture& texture = document_.model.textures[static_cast<size_t>(ref.texture)];
    document_.usage.mark("textures", ref.texture);
    document_.usage.mark("samplers", texture.sampler);
    // One in an unsupported format was warned about: the factor alone stays.
    if (imagesOf(texture).empty()) ref = {};
  });
  uvs_.push_back(assignUvSlots(material, fileMaterial));
  forEachTexture(material, [&](TextureRef& ref, bool isColour, bool) {
    if (!ref) return;
    const auto next = static_cast<int32_t>(textures_.size());
    ref.texture = textures_.emplace(std::make_pair(ref.texture, isColour), next).first->second;
  });
  scene_.materials.push_back(std::move(material));
  return placed;
}

std::shared_ptr<const Image> MaterialTable::pixels(const DecodedImage& decoded, int fileTexture, bool isColour,
                                                   bool isNormal) {
  if (!decoded.ktx2) return decoded.image;
  if (decoded.ktx2->srgb != isColour && decoded.image->floats.empty()) {
    document_.report.warn("/textures/" + std::to_string(fileTexture),
                          isColour
                              ? "the KTX2 file says that its colours are linear; as glTF demands, they are read as sRGB"
                              : "the KTX2 file says that it holds sRGB colours; as glTF demands, they are read as "
                                "linear");
  }
  return isNormal && decoded.ktx2->isRedGreen ? withNormalZ(*decoded.image) : decoded.image;
}

void MaterialTable::loadTextures() {
  std::set<int> used;
  for (const auto& [key, number] : textures_) used.insert(key.first);
  const ImageTable images(document_, used);
  std::set<int32_t> normals;
  for (const Material& m : scene_.materials)
    normals.insert({m.normalTexture.texture, m.clearcoatNormalTexture.texture});
  scene_.textures.resize(textures_.size());
  for (const auto& [key, number] : textures_) {
    const auto [fileTexture, isColour] = key;
    const DecodedImage* decoded = images.of(fileTexture);
    if (!decoded) continue;
    const tinygltf::Texture& texture = document_.model.textures[static_cast<size_t>(fileTexture)];
    const tinygltf::Sampler sampler =
        texture.sampler < 0 ? tinygltf::Sampler() : document_.model.samplers[static_cast<size_t>(texture.sampler)];
    scene_.textures[static_cast<size_t>(number)] = Texture(
        pixels(*decoded, fileTexture, isColour, normals.contains(number)), isColour, wrapOf(sampler.wrapS),
        wrapOf(sampler.wrapT), sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST ? Filter::Nearest : Filter::Linear);
  }
  dropMissingTextures();
}

// A texture that cannot be had leaves its factor alone.
void MaterialTable::dropMissingTextures() {
  std::vector<int32_t> placed(scene_.textures.size(), -1);
  int32_t kept = 0;
  for (size_t i = 0; i < placed.size(); ++i) {
    if (scene_.textures[i].sharedImage()) placed[i] = kept++;
  }
  std::erase_if(scene_.textures, [](const Texture& texture) { return !texture.sharedImage(); });
  for (Material& material : scene_.materials) {
    forEachTexture(material, [&](TextureRef& ref, bool, bool) {
      if (ref) ref.texture = placed[static_cast<size_t>(ref.texture)];
    });
  }
}

}  // namespace braid::gltf
