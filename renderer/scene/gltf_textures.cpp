// SPDX-License-Identifier: Apache-2.0
// Kept materials: uv slots, texture indices, and decoding of the images they read.
#include <algorithm>
#include <atomic>
#include <set>

#include "renderer/core/parallel.h"
#include "renderer/scene/gltf_material.h"

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

// Factors of exactly zero switch whole lobes off; their textures need not be read.
void dropUnreadTextures(Material& m) {
  if (isBlack(m.emission)) m.emissiveTexture = {};
  if (m.transmission == 0) m.transmissionTexture = {};
  if (m.diffuseTransmission == 0) m.diffuseTransmissionTexture = m.diffuseTransmissionColorTexture = {};
  if (m.clearcoat == 0) m.clearcoatTexture = m.clearcoatRoughnessTexture = m.clearcoatNormalTexture = {};
  if (isBlack(m.sheenColor)) m.sheenColorTexture = m.sheenRoughnessTexture = {};
  if (m.anisotropy == 0) m.anisotropyTexture = {};
  if (m.iridescence == 0) m.iridescenceTexture = m.iridescenceThicknessTexture = {};
  if (m.specular == 0) m.specularTexture = m.specularColorTexture = {};
}

struct DecodedImage {
  std::vector<uint8_t> file;  // of an external image
  Bytes encoded;
  std::shared_ptr<const Image> image;
  std::string problem;
};

// Small files can hold huge empty pictures: bounds what all of them together may take.
class PixelBudget {
 public:
  explicit PixelBudget(uint64_t sourceBytes) : limit_(kAlways + kTimesSource * sourceBytes) {}
  bool spent() const { return used_ > limit_; }
  void add(uint64_t bytes) { used_ += bytes; }

 private:
  static constexpr uint64_t kAlways = uint64_t(8) << 30, kTimesSource = 256;
  uint64_t limit_;
  std::atomic<uint64_t> used_{0};
};

void decode(const Document& document, const ImageSource& source, PixelBudget& budget, DecodedImage& out) {
  if (budget.spent()) {
    out.problem = "is one image too many: together they take too much memory; make them smaller";
    return;
  }
  if (source.view != kNone) {
    const BufferView& view = document.views[source.view];
    if (!view.valid) return;
    out.encoded = view.data;
  } else {
    std::optional<std::vector<uint8_t>> data = readUri(document, source.uri, out.problem);
    if (!data) return;
    out.file = std::move(*data);
    out.encoded = out.file;
  }
  const bool named = source.view == kNone && !source.uri.starts_with("data:");
  try {
    out.image = decodeImage(out.encoded.data(), out.encoded.size(), named ? source.uri : source.name);
    budget.add(out.image->bytes.size() + out.image->floats.size() * sizeof(float));
  } catch (const Error& error) {
    out.problem = error.what();
  }
}

}  // namespace

MaterialTable::Uvs MaterialTable::assignUvSlots(Material& material, uint32_t fileMaterial) {
  std::set<uint32_t> sets;
  forEachTexture(material, [&](const TextureRef& ref, bool) {
    if (ref) sets.insert(ref.uvSet);
  });
  Uvs uvs;
  uvs.tangents = tangentSources(material);
  if (sets.size() > 2) {
    document_.report.warn("/materials/" + std::to_string(fileMaterial),
                          "a material reads more than two uv sets; the first two are used");
  }
  if (sets.empty() || *sets.rbegin() <= 1) {
    for (const uint32_t set : sets) uvs.set[set] = set;
    return uvs;
  }
  size_t slot = 0;
  for (const uint32_t set : sets) {
    if (slot < 2) uvs.set[slot++] = set;
  }
  forEachTexture(material, [&](TextureRef& ref, bool) { ref.uvSet = ref.uvSet == uvs.set[1] ? 1 : 0; });
  return uvs;
}

uint32_t MaterialTable::use(uint32_t fileMaterial) {
  uint32_t& placed = placed_[fileMaterial == kNone ? placed_.size() - 1 : fileMaterial];
  if (placed != kNone) return placed;
  placed = static_cast<uint32_t>(scene_.materials.size());
  Material material;
  if (fileMaterial == kNone) {
    material.name = "default";
  } else {
    material = document_.materials[fileMaterial];
  }
  material.doubleSided |= doubleSided_;
  dropUnreadTextures(material);
  uvs_.push_back(assignUvSlots(material, fileMaterial));
  forEachTexture(material, [&](TextureRef& ref, bool isColour) {
    if (!ref) return;
    const auto next = static_cast<int32_t>(textures_.size());
    ref.texture = textures_.emplace(std::make_pair(ref.texture, isColour), next).first->second;
  });
  scene_.materials.push_back(std::move(material));
  return placed;
}

std::vector<uint32_t> MaterialTable::usedImages() const {
  std::set<uint32_t> used;
  for (const auto& [key, index] : textures_) used.insert(document_.textures[static_cast<size_t>(key.first)].image);
  return {used.begin(), used.end()};
}

void MaterialTable::loadTextures() {
  const std::vector<uint32_t> used = usedImages();
  std::vector<DecodedImage> decoded(document_.images.size());
  // Two entries for one file or view share its pixels.
  std::map<std::pair<std::string, uint32_t>, uint32_t> firstOf;
  std::vector<uint32_t> unique;
  for (const uint32_t image : used) {
    const ImageSource& source = document_.images[image];
    if (firstOf.emplace(std::make_pair(source.uri, source.view), image).second) unique.push_back(image);
  }
  PixelBudget budget(document_.sourceBytes());
  parallelFor(unique.size(),
              [&](size_t i) { decode(document_, document_.images[unique[i]], budget, decoded[unique[i]]); });
  for (const uint32_t image : unique) {
    DecodedImage& item = decoded[image];
    if (!item.problem.empty()) document_.report.problem("/images/" + std::to_string(image), item.problem);
    if (item.image && item.image->limited > 0)
      document_.report.warn(
          "/images/" + std::to_string(image),
          std::to_string(item.image->limited) + " values are not finite, negative or above 1e18; they are limited");
    if (item.image && document_.images[image].view == kNone)
      document_.hash.add(item.encoded.data(), item.encoded.size());
    item.file = {};
  }
  scene_.textures.resize(textures_.size());
  for (const auto& [key, index] : textures_) {
    const TextureSource& source = document_.textures[static_cast<size_t>(key.first)];
    const ImageSource& image = document_.images[source.image];
    const std::shared_ptr<const Image>& pixels = decoded[firstOf.at({image.uri, image.view})].image;
    if (!pixels) continue;
    scene_.textures[static_cast<size_t>(index)] =
        Texture(pixels, key.second, source.wrapU, source.wrapV, source.filter);
  }
}

}  // namespace braid::gltf
