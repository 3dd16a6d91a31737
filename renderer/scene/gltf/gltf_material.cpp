// SPDX-License-Identifier: Apache-2.0
// Materials of a glTF file, with their extensions, as plain data. Factors out of range are clamped with a warning.
#include <algorithm>
#include <cmath>

#include "renderer/scene/gltf/gltf_material.h"

namespace braid::gltf {

namespace {

constexpr double kLargest = std::numeric_limits<float>::max();

Spectrum colour(const std::vector<double>& c, const Spectrum& fallback) {
  return c.size() < 3 ? fallback : Spectrum(c[0], c[1], c[2]);
}

// The numbers of an extension's array; none if it is absent.
std::vector<double> numbers(const Value& object, const char* name) {
  const Value& list = member(object, name);
  std::vector<double> out;
  for (size_t i = 0; i < list.ArrayLen(); ++i) out.push_back(list.Get(static_cast<int>(i)).GetNumberAsDouble());
  return out;
}

Spectrum colour(const Value& object, const char* name, const Spectrum& fallback) {
  return colour(numbers(object, name), fallback);
}

float factor(const Value& object, const char* name, double fallback) {
  return static_cast<float>(number(object, name, fallback));
}

// Beyond it nearly all light goes straight on, or straight back, and floats tell no more directions.
constexpr float kMostAnisotropy = 0.9999f;

// Albedo of one event in a dense medium that looks of this colour after many (KHR_materials_volume_scatter; Kulla and
// Conty 2017, "Revisiting Physically Based Shading at Imageworks"). The fit leaves black a little, which is nothing.
float singleScatteringAlbedo(float color) {
  if (!(color > 0)) return 0;
  const auto c = static_cast<double>(color);
  const double s = 4.09712 + 4.20863 * c - std::sqrt(9.59217 + 41.6808 * c + 17.7126 * c * c);
  return static_cast<float>(std::clamp(1 - s * s, 0.0, 1.0));
}

// u' = T R S u with the rotation of the extension: counter-clockwise in an image whose v axis points down.
void readTransform(const Value& json, TextureRef& ref) {
  if (!json.IsObject()) return;
  std::vector<double> offset = numbers(json, "offset"), scale = numbers(json, "scale");
  if (offset.size() != 2) offset = {0, 0};
  if (scale.size() != 2) scale = {1, 1};
  const auto ox = static_cast<float>(offset[0]), oy = static_cast<float>(offset[1]);
  const auto sx = static_cast<float>(scale[0]), sy = static_cast<float>(scale[1]);
  const float rotation = factor(json, "rotation", 0);
  const float c = std::cos(rotation), s = std::sin(rotation);
  ref.matrix = {c * sx, s * sy, ox, -s * sx, c * sy, oy};
  ref.transformed = ref.matrix != std::array<float, 6>{1, 0, 0, 0, 1, 0};
}

class MaterialReader {
 public:
  explicit MaterialReader(Document& document) : document_(document) {}

  Material read(const tinygltf::Material& source, const std::string& place) {
    Material m;
    m.name = source.name;
    metallicRoughness(m, source.pbrMetallicRoughness);
    specularGlossiness(m, member(source.extensions, "KHR_materials_pbrSpecularGlossiness"));
    surface(m, source, place);
    dielectric(m, source.extensions, place);
    transmission(m, source.extensions, place);
    scattering(m, source.extensions, place);
    coatAndSheen(m, source.extensions);
    anisotropyAndIridescence(m, source.extensions);
    return m;
  }

 private:
  TextureRef texture(int index, int set, const Value& transform) const {
    TextureRef ref;
    if (index < 0) return ref;
    readTransform(transform, ref);
    ref.uvSet = static_cast<uint8_t>(number(transform, "texCoord", set));
    ref.texture = index;
    return ref;
  }

  template <class Info>
  TextureRef texture(const Info& info) const {
    return texture(info.index, info.texCoord, member(info.extensions, "KHR_texture_transform"));
  }

  TextureRef texture(const Value& extension, const char* name) const {
    const Value& info = member(extension, name);
    return texture(index(info, "index"), static_cast<int>(number(info, "texCoord", 0)),
                   member(member(info, "extensions"), "KHR_texture_transform"));
  }

  void metallicRoughness(Material& m, const tinygltf::PbrMetallicRoughness& json) const {
    m.baseColor = colour(json.baseColorFactor, Spectrum(1));
    m.alpha = static_cast<float>(json.baseColorFactor[3]);
    m.baseColorTexture = texture(json.baseColorTexture);
    m.metallic = static_cast<float>(json.metallicFactor);
    m.roughness = static_cast<float>(json.roughnessFactor);
    m.metallicRoughnessTexture = texture(json.metallicRoughnessTexture);
  }

  void specularGlossiness(Material& m, const Value& json) const {
    if (!json.IsObject()) return;
    const std::vector<double> diffuse = numbers(json, "diffuseFactor");
    m.specularGlossiness = true;
    m.baseColor = colour(diffuse, Spectrum(1));
    m.alpha = diffuse.size() == 4 ? static_cast<float>(diffuse[3]) : 1;
    m.baseColorTexture = texture(json, "diffuseTexture");
    m.metallic = 0;
    m.metallicRoughnessTexture = {};
    m.roughness = 1 - factor(json, "glossinessFactor", 1);
    m.specularF0 = colour(json, "specularFactor", Spectrum(1));
    m.specularGlossinessTexture = texture(json, "specularGlossinessTexture");
  }

  void surface(Material& m, const tinygltf::Material& json, const std::string& place) const {
    m.normalTexture = texture(json.normalTexture);
    m.normalScale = static_cast<float>(json.normalTexture.scale);
    // Brighter factors than the core allows are common and harmless, so only negative ones are changed.
    const double strength = number(member(json.extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1);
    for (int i = 0; i < 3; ++i) {
      const double emission = static_cast<double>(static_cast<float>(json.emissiveFactor[static_cast<size_t>(i)])) *
                              static_cast<double>(static_cast<float>(strength));
      m.emission[i] = static_cast<float>(std::min(emission, kLargest));
      if (emission > kLargest)
        document_.report.problem(place + "/emissiveFactor",
                                 "times emissiveStrength is too large; write smaller numbers",
                                 "the largest one is used");
    }
    m.emissiveTexture = texture(json.emissiveTexture);
    m.doubleSided = json.doubleSided;
    m.unlit = json.extensions.contains("KHR_materials_unlit");
    m.alphaMode = json.alphaMode == "MASK"    ? AlphaMode::Mask
                  : json.alphaMode == "BLEND" ? AlphaMode::Blend
                                              : AlphaMode::Opaque;
    m.alphaCutoff = static_cast<float>(json.alphaCutoff);
  }

  void dielectric(Material& m, const tinygltf::ExtensionMap& extensions, const std::string& place) const {
    const std::string ior = place + "/extensions/KHR_materials_ior/ior";
    m.ior = factor(member(extensions, "KHR_materials_ior"), "ior", 1.5);
    if (m.ior != 0 && m.ior < 1) {
      document_.report.warn(ior, "an index of refraction is below 1; 1 is used");
      m.ior = 1;
    }
    if (m.ior > kLargestIor) {
      document_.report.warn(ior, "an index of refraction is above 100; 100 is used");
      m.ior = kLargestIor;
    }
    m.dispersion = factor(member(extensions, "KHR_materials_dispersion"), "dispersion", 0);
    const Value& specular = member(extensions, "KHR_materials_specular");
    m.specular = factor(specular, "specularFactor", 1);
    m.specularTexture = texture(specular, "specularTexture");
    m.specularColor = colour(specular, "specularColorFactor", Spectrum(1));
    m.specularColorTexture = texture(specular, "specularColorTexture");
  }

  void transmission(Material& m, const tinygltf::ExtensionMap& extensions, const std::string& place) const {
    const Value& transmission = member(extensions, "KHR_materials_transmission");
    m.transmission = factor(transmission, "transmissionFactor", 0);
    m.transmissionTexture = texture(transmission, "transmissionTexture");
    // The thickness texture is not used: paths measure the thickness.
    const Value& volume = member(extensions, "KHR_materials_volume");
    m.thinWalled = factor(volume, "thicknessFactor", 0) == 0;
    m.attenuationColor = colour(volume, "attenuationColor", Spectrum(1));
    const double distance = number(volume, "attenuationDistance", kLargest);
    // JSON cannot write infinity: the largest float stands for it.
    m.attenuationDistance = distance < kLargest ? static_cast<float>(distance) : kInfinity;
    if (m.attenuationDistance <= 0) {
      document_.report.warn(place + "/extensions/KHR_materials_volume/attenuationDistance",
                            "is not positive; no attenuation is used");
      m.attenuationDistance = kInfinity;
    }
    if (m.dispersion > 0 && !m.disperses())
      document_.report.warn(place + "/extensions/KHR_materials_dispersion",
                            "dispersion needs transmission, a volume and an index above 1; it has no effect");
    const Value& diffuse = member(extensions, "KHR_materials_diffuse_transmission");
    m.diffuseTransmission = factor(diffuse, "diffuseTransmissionFactor", 0);
    m.diffuseTransmissionTexture = texture(diffuse, "diffuseTransmissionTexture");
    m.diffuseTransmissionColor = colour(diffuse, "diffuseTransmissionColorFactor", Spectrum(1));
    m.diffuseTransmissionColorTexture = texture(diffuse, "diffuseTransmissionColorTexture");
  }

  void scattering(Material& m, const tinygltf::ExtensionMap& extensions, const std::string& place) const {
    const Value& scatter = member(extensions, "KHR_materials_volume_scatter");
    if (!scatter.IsObject()) return;
    const std::string at = place + "/extensions/KHR_materials_volume_scatter";
    // The factor's name in older drafts.
    const Spectrum older = colour(scatter, "multiscatterColor", Spectrum(0));
    const Spectrum color = colour(scatter, "multiscatterColorFactor", older);
    m.scatterAlbedo = {singleScatteringAlbedo(color.x), singleScatteringAlbedo(color.y),
                       singleScatteringAlbedo(color.z)};
    m.scatterAnisotropy = factor(scatter, "scatterAnisotropy", 0);
    if (std::fabs(m.scatterAnisotropy) > kMostAnisotropy) {
      document_.report.warn(at + "/scatterAnisotropy", "is not between -1 and 1; 0.9999 of its sign is used");
      m.scatterAnisotropy = std::copysign(kMostAnisotropy, m.scatterAnisotropy);
    }
    if (index(member(scatter, "multiscatterColorTexture"), "index") >= 0)
      document_.report.warn(at + "/multiscatterColorTexture",
                            "is not read, as a medium has one colour; the factor alone is used");
    if (!isBlack(color) && !m.scatters())
      document_.report.warn(at,
                            "scattering needs transmission or diffuse transmission, a volume with a "
                            "thicknessFactor above 0, and its attenuation; it has no effect");
  }

  void coatAndSheen(Material& m, const tinygltf::ExtensionMap& extensions) const {
    const Value& coat = member(extensions, "KHR_materials_clearcoat");
    m.clearcoat = factor(coat, "clearcoatFactor", 0);
    m.clearcoatTexture = texture(coat, "clearcoatTexture");
    m.clearcoatRoughness = factor(coat, "clearcoatRoughnessFactor", 0);
    m.clearcoatRoughnessTexture = texture(coat, "clearcoatRoughnessTexture");
    m.clearcoatNormalTexture = texture(coat, "clearcoatNormalTexture");
    m.clearcoatNormalScale = factor(member(coat, "clearcoatNormalTexture"), "scale", 1);
    const Value& sheen = member(extensions, "KHR_materials_sheen");
    m.sheenColor = colour(sheen, "sheenColorFactor", Spectrum(0));
    m.sheenColorTexture = texture(sheen, "sheenColorTexture");
    m.sheenRoughness = factor(sheen, "sheenRoughnessFactor", 0);
    m.sheenRoughnessTexture = texture(sheen, "sheenRoughnessTexture");
  }

  void anisotropyAndIridescence(Material& m, const tinygltf::ExtensionMap& extensions) const {
    const Value& anisotropy = member(extensions, "KHR_materials_anisotropy");
    m.anisotropy = factor(anisotropy, "anisotropyStrength", 0);
    m.anisotropyRotation = factor(anisotropy, "anisotropyRotation", 0);
    m.anisotropyTexture = texture(anisotropy, "anisotropyTexture");
    const Value& film = member(extensions, "KHR_materials_iridescence");
    m.iridescence = factor(film, "iridescenceFactor", 0);
    m.iridescenceTexture = texture(film, "iridescenceTexture");
    m.iridescenceIor = factor(film, "iridescenceIor", 1.3);
    m.iridescenceThicknessMin = factor(film, "iridescenceThicknessMinimum", 100);
    m.iridescenceThicknessMax = factor(film, "iridescenceThicknessMaximum", 400);
    m.iridescenceThicknessTexture = texture(film, "iridescenceThicknessTexture");
  }

  Document& document_;
};

}  // namespace

std::vector<int> imagesOf(const tinygltf::Texture& texture) {
  std::vector<int> images = {index(member(texture.extensions, "KHR_texture_basisu"), "source"),
                             index(member(texture.extensions, "EXT_texture_avif"), "source"),
                             index(member(texture.extensions, "EXT_texture_webp"), "source"), texture.source};
  std::erase_if(images, [](int image) { return image < 0; });
  return images;
}

Material readMaterial(Document& document, const tinygltf::Material& source, size_t index) {
  Material material = MaterialReader(document).read(source, "/materials/" + std::to_string(index));
  if (material.name.empty()) material.name = "material " + std::to_string(index);
  return material;
}

void readMaterials(Document& document) {
  const std::vector<tinygltf::Material>& list = document.model.materials;
  for (size_t i = 0; i < document.model.textures.size(); ++i) {
    if (imagesOf(document.model.textures[i]).empty())
      document.report.warn(
          "/textures/" + std::to_string(i),
          "has no image in a format that is supported (PNG, JPEG, WebP, AVIF, KTX2); factors alone are used");
  }
  for (size_t i = 0; i < list.size(); ++i) {
    document.materials.push_back(readMaterial(document, list[i], i));
  }
  // What tinygltf holds of materials is large and read by now.
  document.model.materials = {};
}

}  // namespace braid::gltf
