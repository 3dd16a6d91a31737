// SPDX-License-Identifier: Apache-2.0
// Materials of a glTF file, with their extensions, as plain data. Factors out of range are clamped with a warning.
#include <algorithm>
#include <cmath>

#include "renderer/scene/gltf_material.h"

namespace braid::gltf {

namespace {

constexpr float kLargestIor = 100;
constexpr float kLargest = std::numeric_limits<float>::max();
// More texture coordinate sets than this exist in no real file.
constexpr uint64_t kMaxUvSet = 31;

Spectrum readColor(const JsonRef& json, const Spectrum& fallback, float high) {
  float c[3];
  if (!json.reals(c, 3)) return fallback;
  const Spectrum value(c[0], c[1], c[2]);
  const Spectrum clamped = glm::clamp(value, Spectrum(0), Spectrum(high));
  if (clamped != value) json.warn("a colour factor lies outside its range; it is clamped");
  return clamped;
}

// u' = T R S u with the rotation of the extension: counter-clockwise in an image whose v axis points down.
void readTransform(const JsonRef& json, TextureRef& ref) {
  if (!json) return;
  float offset[2] = {0, 0}, scale[2] = {1, 1};
  json["offset"].reals(offset, 2);
  json["scale"].reals(scale, 2);
  const float rotation = json["rotation"].real(0);
  const float c = std::cos(rotation), s = std::sin(rotation);
  ref.matrix = {c * scale[0], s * scale[1], offset[0], -s * scale[0], c * scale[1], offset[1]};
  ref.transformed = ref.matrix != std::array<float, 6>{1, 0, 0, 0, 1, 0};
}

class MaterialReader {
 public:
  explicit MaterialReader(const Document& document) : document_(document) {}

  TextureRef texture(const JsonRef& json) const {
    TextureRef ref;
    if (!json) return ref;
    const uint32_t index =
        json["index"].required("write the index of a texture").index(document_.textures.size(), "textures");
    const JsonRef transform = json.extension("KHR_texture_transform");
    uint64_t set = json["texCoord"].whole(0, kMaxUvSet);
    if (transform) set = transform["texCoord"].whole(set, kMaxUvSet);
    readTransform(transform, ref);
    ref.uvSet = static_cast<uint8_t>(set);
    // A texture in an unsupported format was warned about; the factor alone stays.
    if (index != kNone && document_.textures[index].image != kNone) ref.texture = static_cast<int32_t>(index);
    return ref;
  }

  void metallicRoughness(Material& m, const JsonRef& json) const {
    m.baseColor = factorWithAlpha(json["baseColorFactor"], m.alpha);
    m.baseColorTexture = texture(json["baseColorTexture"]);
    m.metallic = json["metallicFactor"].clamped(1, 0, 1);
    m.roughness = json["roughnessFactor"].clamped(1, 0, 1);
    m.metallicRoughnessTexture = texture(json["metallicRoughnessTexture"]);
  }

  void specularGlossiness(Material& m, const JsonRef& json) const {
    if (!json) return;
    m.specularGlossiness = true;
    m.baseColor = factorWithAlpha(json["diffuseFactor"], m.alpha);
    m.baseColorTexture = texture(json["diffuseTexture"]);
    m.metallic = 0;
    m.metallicRoughnessTexture = {};
    m.roughness = 1 - json["glossinessFactor"].clamped(1, 0, 1);
    m.specularF0 = readColor(json["specularFactor"], Spectrum(1), 1);
    m.specularGlossinessTexture = texture(json["specularGlossinessTexture"]);
  }

  void surface(Material& m, const JsonRef& json) const {
    m.normalTexture = texture(json["normalTexture"]);
    m.normalScale = json["normalTexture"]["scale"].real(1);
    texture(json["occlusionTexture"]);  // checked, not used: a path tracer computes occlusion
    // Brighter factors than the core allows are common and harmless, so only negative ones are changed.
    m.emission = readColor(json["emissiveFactor"], Spectrum(0), kLargest);
    const float strength =
        json.extension("KHR_materials_emissive_strength")["emissiveStrength"].clamped(1, 0, kLargest);
    m.emission *= strength;
    if (!isFinite(m.emission))
      json["emissiveFactor"].problem("times emissiveStrength is too large; write smaller numbers");
    m.emissiveTexture = texture(json["emissiveTexture"]);
    m.doubleSided = json["doubleSided"].boolean(false);
    m.unlit = static_cast<bool>(json.extension("KHR_materials_unlit"));
    alphaMode(m, json);
  }

  void dielectric(Material& m, const JsonRef& json) const {
    const JsonRef ior = json.extension("KHR_materials_ior")["ior"];
    m.ior = ior.real(1.5f);
    if (m.ior != 0 && m.ior < 1) {
      ior.warn("an index of refraction is below 1; 1 is used");
      m.ior = 1;
    }
    if (m.ior > kLargestIor) {
      ior.warn("an index of refraction is above 100; 100 is used");
      m.ior = kLargestIor;
    }
    m.dispersion = json.extension("KHR_materials_dispersion")["dispersion"].clamped(0, 0, kLargest);
    const JsonRef specular = json.extension("KHR_materials_specular");
    m.specular = specular["specularFactor"].clamped(1, 0, 1);
    m.specularTexture = texture(specular["specularTexture"]);
    m.specularColor = readColor(specular["specularColorFactor"], Spectrum(1), kLargest);
    m.specularColorTexture = texture(specular["specularColorTexture"]);
  }

  void transmission(Material& m, const JsonRef& json) const {
    const JsonRef transmission = json.extension("KHR_materials_transmission");
    m.transmission = transmission["transmissionFactor"].clamped(0, 0, 1);
    m.transmissionTexture = texture(transmission["transmissionTexture"]);
    const JsonRef volume = json.extension("KHR_materials_volume");
    m.thinWalled = volume["thicknessFactor"].clamped(0, 0, kLargest) == 0;
    texture(volume["thicknessTexture"]);  // checked, not used: paths measure the thickness
    m.attenuationColor = readColor(volume["attenuationColor"], Spectrum(1), 1);
    m.attenuationDistance = volume["attenuationDistance"].real(kInfinity);
    if (m.attenuationDistance <= 0) {
      volume["attenuationDistance"].warn("is not positive; no attenuation is used");
      m.attenuationDistance = kInfinity;
    }
    const JsonRef diffuse = json.extension("KHR_materials_diffuse_transmission");
    m.diffuseTransmission = diffuse["diffuseTransmissionFactor"].clamped(0, 0, 1);
    m.diffuseTransmissionTexture = texture(diffuse["diffuseTransmissionTexture"]);
    m.diffuseTransmissionColor = readColor(diffuse["diffuseTransmissionColorFactor"], Spectrum(1), 1);
    m.diffuseTransmissionColorTexture = texture(diffuse["diffuseTransmissionColorTexture"]);
  }

  void coatAndSheen(Material& m, const JsonRef& json) const {
    const JsonRef coat = json.extension("KHR_materials_clearcoat");
    m.clearcoat = coat["clearcoatFactor"].clamped(0, 0, 1);
    m.clearcoatTexture = texture(coat["clearcoatTexture"]);
    m.clearcoatRoughness = coat["clearcoatRoughnessFactor"].clamped(0, 0, 1);
    m.clearcoatRoughnessTexture = texture(coat["clearcoatRoughnessTexture"]);
    m.clearcoatNormalTexture = texture(coat["clearcoatNormalTexture"]);
    m.clearcoatNormalScale = coat["clearcoatNormalTexture"]["scale"].real(1);
    const JsonRef sheen = json.extension("KHR_materials_sheen");
    m.sheenColor = readColor(sheen["sheenColorFactor"], Spectrum(0), 1);
    m.sheenColorTexture = texture(sheen["sheenColorTexture"]);
    m.sheenRoughness = sheen["sheenRoughnessFactor"].clamped(0, 0, 1);
    m.sheenRoughnessTexture = texture(sheen["sheenRoughnessTexture"]);
  }

  void anisotropyAndIridescence(Material& m, const JsonRef& json) const {
    const JsonRef anisotropy = json.extension("KHR_materials_anisotropy");
    m.anisotropy = anisotropy["anisotropyStrength"].clamped(0, 0, 1);
    m.anisotropyRotation = anisotropy["anisotropyRotation"].real(0);
    m.anisotropyTexture = texture(anisotropy["anisotropyTexture"]);
    const JsonRef film = json.extension("KHR_materials_iridescence");
    m.iridescence = film["iridescenceFactor"].clamped(0, 0, 1);
    m.iridescenceTexture = texture(film["iridescenceTexture"]);
    m.iridescenceIor = film["iridescenceIor"].clamped(1.3f, 1, kLargest);
    m.iridescenceThicknessMin = film["iridescenceThicknessMinimum"].clamped(100, 0, kLargest);
    m.iridescenceThicknessMax = film["iridescenceThicknessMaximum"].clamped(400, 0, kLargest);
    m.iridescenceThicknessTexture = texture(film["iridescenceThicknessTexture"]);
  }

 private:
  static Spectrum factorWithAlpha(const JsonRef& json, float& alpha) {
    float c[4] = {1, 1, 1, 1};
    if (json.reals(c, 4)) {
      float clamped[4];
      std::transform(c, c + 4, clamped, [](float v) { return std::clamp(v, 0.0f, 1.0f); });
      if (!std::equal(c, c + 4, clamped)) json.warn("a colour factor lies outside 0 to 1; it is clamped");
      std::copy(clamped, clamped + 4, c);
    }
    alpha = c[3];
    return Spectrum(c[0], c[1], c[2]);
  }

  static void alphaMode(Material& m, const JsonRef& json) {
    const std::string mode = json["alphaMode"].text("OPAQUE");
    if (mode == "MASK") {
      m.alphaMode = AlphaMode::Mask;
    } else if (mode == "BLEND") {
      m.alphaMode = AlphaMode::Blend;
    } else if (mode != "OPAQUE") {
      json["alphaMode"].problem("is " + quoted(mode) + "; it must be one of OPAQUE, MASK, BLEND");
    }
    m.alphaCutoff = json["alphaCutoff"].clamped(0.5f, 0, kLargest);
  }

  const Document& document_;
};

}  // namespace

void parseMaterials(Document& document, const JsonRef& root) {
  const JsonRef list = root["materials"];
  const MaterialReader reader(document);
  document.materials.resize(list.size());
  for (size_t i = 0; i < document.materials.size(); ++i) {
    const JsonRef json = list.at(i);
    Material& material = document.materials[i];
    material.name = json["name"].text("material " + std::to_string(i));
    reader.metallicRoughness(material, json["pbrMetallicRoughness"]);
    reader.specularGlossiness(material, json.extension("KHR_materials_pbrSpecularGlossiness"));
    reader.surface(material, json);
    reader.dielectric(material, json);
    reader.transmission(material, json);
    reader.coatAndSheen(material, json);
    reader.anisotropyAndIridescence(material, json);
  }
}

}  // namespace braid::gltf
