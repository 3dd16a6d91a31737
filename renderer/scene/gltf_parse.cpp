// SPDX-License-Identifier: Apache-2.0
// JSON to structs: extensions, buffer views, accessors, meshes, textures and images.
#include <algorithm>
#include <array>
#include <cstring>

#include "renderer/scene/gltf_document.h"

namespace braid::gltf {

namespace {

constexpr const char* kSupported[] = {
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_transform",
};

bool isSupported(const std::string& name) {
  return std::find(std::begin(kSupported), std::end(kSupported), name) != std::end(kSupported);
}

void parseBuffers(Document& document, const JsonRef& list) {
  document.buffers.resize(list.size());
  for (size_t i = 0; i < document.buffers.size(); ++i) {
    const JsonRef json = list.at(i);
    json["byteLength"].required("write the size of the buffer in bytes").whole(0);
    json["uri"].text();
    for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
      if (json.extension(name)["fallback"].boolean(false)) document.buffers[i].meshoptFallback = true;
    }
  }
}

// One of a few words; reports others.
template <class Value>
Value choice(const JsonRef& json, std::initializer_list<std::pair<const char*, Value>> words, Value fallback) {
  if (!json) return fallback;
  const std::string text = json.text(words.begin()->first);
  std::string known;
  for (const auto& [word, value] : words) {
    if (text == word) return value;
    known += known.empty() ? word : std::string(", ") + word;
  }
  json.problem("is " + quoted(text) + "; it must be one of " + known);
  return fallback;
}

MeshoptView parseMeshopt(const JsonRef& json, size_t bufferCount) {
  MeshoptView view;
  view.buffer =
      json["buffer"].required("write the index of the buffer with the compressed data").index(bufferCount, "buffers");
  view.offset = json["byteOffset"].whole(0);
  view.length = json["byteLength"].required("write the compressed size").whole(0);
  view.stride = json["byteStride"].required("write the size of one element").whole(0, 256);
  view.count = json["count"].required("write the number of elements").whole(0);
  view.mode = choice<MeshoptMode>(json["mode"].required("write ATTRIBUTES, TRIANGLES or INDICES"),
                                  {{"ATTRIBUTES", MeshoptMode::Attributes},
                                   {"TRIANGLES", MeshoptMode::Triangles},
                                   {"INDICES", MeshoptMode::Indices}},
                                  MeshoptMode::Attributes);
  view.filter = choice<MeshoptFilter>(json["filter"],
                                      {{"NONE", MeshoptFilter::None},
                                       {"OCTAHEDRAL", MeshoptFilter::Octahedral},
                                       {"QUATERNION", MeshoptFilter::Quaternion},
                                       {"EXPONENTIAL", MeshoptFilter::Exponential}},
                                      MeshoptFilter::None);
  return view;
}

void parseViews(Document& document, const JsonRef& list) {
  document.views.resize(list.size());
  for (size_t i = 0; i < document.views.size(); ++i) {
    const JsonRef json = list.at(i);
    BufferView& view = document.views[i];
    view.buffer = json["buffer"].required("write the index of a buffer").index(document.buffers.size(), "buffers");
    view.offset = json["byteOffset"].whole(0);
    view.length = json["byteLength"].required("write the size of the view in bytes").whole(0);
    view.stride = json["byteStride"].whole(0, 1 << 20);
    for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
      if (json.extension(name)) view.meshopt = parseMeshopt(json.extension(name), document.buffers.size());
    }
  }
}

Component parseComponent(const JsonRef& json) {
  const uint64_t value =
      json.required("write 5121 (bytes), 5123 (shorts), 5125 (ints) or 5126 (floats)").whole(5126, 65535);
  const bool known = value == 5120 || value == 5121 || value == 5122 || value == 5123 || value == 5125 || value == 5126;
  if (!known) json.problem("is " + std::to_string(value) + "; it must be 5120, 5121, 5122, 5123, 5125 or 5126");
  return known ? static_cast<Component>(value) : Component::F32;
}

void parseAccessorType(const JsonRef& json, Accessor& accessor) {
  using Shape = std::array<uint8_t, 2>;
  const Shape shape = choice<Shape>(json.required("write SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4"),
                                    {{"SCALAR", {1, 1}},
                                     {"VEC2", {2, 1}},
                                     {"VEC3", {3, 1}},
                                     {"VEC4", {4, 1}},
                                     {"MAT2", {2, 2}},
                                     {"MAT3", {3, 3}},
                                     {"MAT4", {4, 4}}},
                                    {1, 1});
  accessor.rows = shape[0];
  accessor.columns = shape[1];
}

SparseAccessor parseSparse(const JsonRef& json, size_t viewCount) {
  SparseAccessor sparse;
  sparse.count = json["count"].required("write the number of replaced elements").whole(0);
  const JsonRef indices = json["indices"].required("describe the replaced indices");
  sparse.indexView = indices["bufferView"].required("write the index of a bufferView").index(viewCount, "bufferViews");
  sparse.indexOffset = indices["byteOffset"].whole(0);
  sparse.indexType = parseComponent(indices["componentType"]);
  const JsonRef values = json["values"].required("describe the new values");
  sparse.valueView = values["bufferView"].required("write the index of a bufferView").index(viewCount, "bufferViews");
  sparse.valueOffset = values["byteOffset"].whole(0);
  return sparse;
}

void parseAccessors(Document& document, const JsonRef& list) {
  document.accessors.resize(list.size());
  for (size_t i = 0; i < document.accessors.size(); ++i) {
    const JsonRef json = list.at(i);
    const size_t before = document.report.problemCount();
    Accessor& accessor = document.accessors[i];
    accessor.view = json["bufferView"].index(document.views.size(), "bufferViews");
    accessor.offset = json["byteOffset"].whole(0);
    accessor.count = json["count"].required("write the number of elements").whole(0);
    accessor.component = parseComponent(json["componentType"]);
    accessor.normalized = json["normalized"].boolean(false);
    parseAccessorType(json["type"], accessor);
    if (json["sparse"]) accessor.sparse = parseSparse(json["sparse"], document.views.size());
    accessor.valid = document.report.problemCount() == before;
  }
}

void parseImages(Document& document, const JsonRef& list) {
  document.images.resize(list.size());
  for (size_t i = 0; i < document.images.size(); ++i) {
    const JsonRef json = list.at(i);
    ImageSource& image = document.images[i];
    image.name = json["name"].text();
    image.uri = json["uri"].text();
    image.mimeType = json["mimeType"].text();
    image.view = json["bufferView"].index(document.views.size(), "bufferViews");
    if (!json["uri"] && !json["bufferView"]) json.problem("has neither uri nor bufferView; add one of them");
  }
}

Wrap parseWrap(const JsonRef& json) {
  switch (const uint64_t value = json.whole(10497, 65535)) {
    case 10497:
      return Wrap::Repeat;
    case 33071:
      return Wrap::Clamp;
    case 33648:
      return Wrap::Mirror;
    default:
      json.problem("is " + std::to_string(value) + "; it must be 33071 (clamp), 33648 (mirror) or 10497 (repeat)");
      return Wrap::Repeat;
  }
}

void parseSampler(const JsonRef& json, TextureSource& texture) {
  texture.wrapU = parseWrap(json["wrapS"]);
  texture.wrapV = parseWrap(json["wrapT"]);
  if (json["magFilter"].whole(9729, 65535) == 9728) texture.filter = Filter::Nearest;
}

void parseTextures(Document& document, const JsonRef& list, const JsonRef& samplers) {
  TextureSource scratch;
  for (size_t i = 0; i < samplers.size(); ++i) parseSampler(samplers.at(i), scratch);
  document.textures.resize(list.size());
  for (size_t i = 0; i < document.textures.size(); ++i) {
    const JsonRef json = list.at(i);
    TextureSource& texture = document.textures[i];
    texture.image = json["source"].index(document.images.size(), "images");
    const uint32_t webp = json.extension("EXT_texture_webp")["source"].index(document.images.size(), "images");
    if (webp != kNone) texture.image = webp;
    const uint32_t sampler = json["sampler"].index(samplers.size(), "samplers");
    if (sampler != kNone) parseSampler(samplers.at(sampler), texture);
    if (texture.image == kNone && !json["source"]) {
      json.warn("has no image in a format that is supported (PNG, JPEG, WebP); white is used");
    }
  }
}

Attributes parseAttributes(const Document& document, const JsonRef& json) {
  Attributes attributes;
  for (const std::string& name : json.keys()) {
    const uint32_t accessor = json[name].index(document.accessors.size(), "accessors");
    if (accessor != kNone) attributes.emplace(name, accessor);
  }
  return attributes;
}

void parseVariants(Primitive& primitive, const Document& document, const JsonRef& mappings, size_t materialCount) {
  for (size_t i = 0; i < mappings.size(); ++i) {
    const JsonRef mapping = mappings.at(i);
    const uint32_t material =
        mapping["material"].required("write the index of a material").index(materialCount, "materials");
    for (const uint32_t variant : mapping["variants"].indices(document.variants.size(), "variants")) {
      primitive.variantMaterials.emplace_back(variant, material);
    }
  }
}

std::optional<DracoPrimitive> parseDraco(const Document& document, const JsonRef& json) {
  if (!json) return {};
  DracoPrimitive draco;
  draco.view = json["bufferView"]
                   .required("write the index of the bufferView with the compressed mesh")
                   .index(document.views.size(), "bufferViews");
  const JsonRef ids = json["attributes"].required("map attribute names to ids in the compressed mesh");
  for (const std::string& name : ids.keys()) draco.ids[name] = static_cast<uint32_t>(ids[name].whole(0, 65535));
  return draco;
}

Primitive parsePrimitive(const Document& document, const JsonRef& json, size_t materialCount) {
  Primitive primitive;
  primitive.pointer = json.pointer();
  primitive.attributes = parseAttributes(document, json["attributes"].required("write at least POSITION"));
  primitive.indices = json["indices"].index(document.accessors.size(), "accessors");
  primitive.material = json["material"].index(materialCount, "materials");
  primitive.mode = json["mode"].whole(4, 6);
  const JsonRef targets = json["targets"];
  for (size_t i = 0; i < targets.size(); ++i) primitive.targets.push_back(parseAttributes(document, targets.at(i)));
  primitive.draco = parseDraco(document, json.extension("KHR_draco_mesh_compression"));
  parseVariants(primitive, document, json.extension("KHR_materials_variants")["mappings"], materialCount);
  return primitive;
}

}  // namespace

void checkExtensions(Document& document, const JsonRef& root) {
  document.extensionsUsed = root["extensionsUsed"].textList();
  document.extensionsRequired = root["extensionsRequired"].textList();
  std::vector<Problem> unsupported;
  for (size_t i = 0; i < document.extensionsRequired.size(); ++i) {
    const std::string& name = document.extensionsRequired[i];
    if (isSupported(name)) continue;
    const char* mend =
        name == "KHR_texture_basisu" ? "export the textures as PNG, JPEG or WebP" : "export the file without it";
    unsupported.push_back(
        {root["extensionsRequired"].at(i).pointer(), "extension " + quoted(name) + " is not supported; " + mend});
  }
  if (!unsupported.empty()) throw SceneError(ExitCode::UnsupportedExtension, document.path, std::move(unsupported));
  std::string ignored;
  for (const std::string& name : document.extensionsUsed) {
    if (isSupported(name)) continue;
    document.extensionsIgnored.push_back(name);
    ignored += (ignored.empty() ? "" : ", ") + quoted(name);
  }
  if (!ignored.empty()) root["extensionsUsed"].warn("extensions that are not supported are ignored: " + ignored);
}

void parseData(Document& document, const JsonRef& root) {
  parseBuffers(document, root["buffers"]);
  parseViews(document, root["bufferViews"]);
  parseAccessors(document, root["accessors"]);
  parseImages(document, root["images"]);
  parseTextures(document, root["textures"], root["samplers"]);
}

void parseMeshes(Document& document, const JsonRef& root) {
  const JsonRef variants = root.extension("KHR_materials_variants")["variants"];
  for (size_t i = 0; i < variants.size(); ++i) document.variants.push_back(variants.at(i)["name"].text());
  const size_t materialCount = root["materials"].size();
  const JsonRef list = root["meshes"];
  document.meshes.resize(list.size());
  for (size_t i = 0; i < document.meshes.size(); ++i) {
    const JsonRef json = list.at(i);
    Mesh& mesh = document.meshes[i];
    mesh.name = json["name"].text("mesh " + std::to_string(i));
    mesh.weights = json["weights"].realList();
    const JsonRef primitives = json["primitives"].required("write at least one primitive");
    for (size_t p = 0; p < primitives.size(); ++p)
      mesh.primitives.push_back(parsePrimitive(document, primitives.at(p), materialCount));
  }
}

}  // namespace braid::gltf
