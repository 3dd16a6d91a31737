// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/document/gltf_schema.h"

namespace braid::gltf {

namespace {

constexpr double kMost = std::numeric_limits<float>::max();
// tinygltf holds indices and counts as int, sizes as size_t; sizes above 2^53 cannot be written exactly in JSON.
constexpr double kMostInt = std::numeric_limits<int32_t>::max(), kMostSize = 9007199254740992.0;
// More texture coordinate sets than this exist in no real file.
constexpr double kMostUvSet = 31;
constexpr const char* kLeftOut = "what reads it is left out";

constexpr Field flag(const char* name) { return {.name = name, .kind = Kind::Bool}; }
constexpr Field text(const char* name) { return {.name = name, .kind = Kind::Text}; }
constexpr Field real(const char* name) { return {.name = name, .kind = Kind::Real}; }
constexpr Field factor(const char* name, double low = 0, double high = 1) {
  return {.name = name, .kind = Kind::Real, .low = low, .high = high};
}
constexpr Field needed(const char* name, const char* fallback, const char* mend = nullptr) {
  return {.name = name, .kind = Kind::Real, .mend = mend, .fallback = fallback, .meanwhile = "a usual value is used"};
}
constexpr Field reals(const char* name, size_t count = 0) {
  return {.name = name, .kind = Kind::Reals, .count = count};
}
constexpr Field colour(const char* name, size_t count = 3, double high = 1) {
  return {.name = name, .kind = Kind::Colour, .low = 0, .high = high, .count = count};
}
constexpr Field whole(const char* name, double high, const char* mend = nullptr, const char* fallback = nullptr) {
  return {.name = name, .kind = Kind::Whole, .high = high, .mend = mend, .fallback = fallback, .meanwhile = kLeftOut};
}
constexpr Field index(const char* name, const char* of, const char* mend = nullptr, const char* fallback = nullptr,
                      const char* ifWrong = nullptr) {
  return {.name = name, .kind = Kind::Index, .of = of, .mend = mend, .fallback = fallback, .ifWrong = ifWrong};
}
constexpr Field indices(const char* name, const char* of, const char* mend = nullptr) {
  return {.name = name, .kind = Kind::Indices, .of = of, .mend = mend, .fallback = mend ? "[]" : nullptr};
}
constexpr Field map(const char* name, const char* of, const char* mend = nullptr) {
  return {.name = name, .kind = Kind::Map, .of = of, .mend = mend, .fallback = mend ? "{}" : nullptr};
}
constexpr Field object(const char* name, std::span<const Field> shape, const char* mend = nullptr,
                       const char* fallback = nullptr) {
  return {.name = name, .kind = Kind::Object, .shape = shape, .mend = mend, .fallback = fallback};
}
constexpr Field list(const char* name, std::span<const Field> shape, const char* mend = nullptr) {
  return {.name = name, .kind = Kind::List, .shape = shape, .mend = mend, .fallback = mend ? "[]" : nullptr};
}
constexpr Field word(const char* name, const char* of, const char* mend = nullptr, const char* fallback = nullptr) {
  return {.name = name, .kind = Kind::Word, .of = of, .mend = mend, .fallback = fallback};
}

constexpr Field kTransform[] = {reals("offset", 2), reals("scale", 2), real("rotation"), whole("texCoord", kMostUvSet)};
constexpr Field kTextureExtensions[] = {object("KHR_texture_transform", kTransform)};
constexpr Field kTexture[] = {index("index", "textures", "write the index of a texture"), whole("texCoord", kMostUvSet),
                              real("scale"), object("extensions", kTextureExtensions)};

constexpr Field kMetallicRoughness[] = {colour("baseColorFactor", 4), object("baseColorTexture", kTexture),
                                        factor("metallicFactor"), factor("roughnessFactor"),
                                        object("metallicRoughnessTexture", kTexture)};
constexpr Field kSpecularGlossiness[] = {colour("diffuseFactor", 4), object("diffuseTexture", kTexture),
                                         factor("glossinessFactor"), colour("specularFactor"),
                                         object("specularGlossinessTexture", kTexture)};
constexpr Field kEmissiveStrength[] = {factor("emissiveStrength", 0, kMost)};
constexpr Field kIor[] = {real("ior")};
constexpr Field kDispersion[] = {factor("dispersion", 0, kMost)};
constexpr Field kSpecular[] = {factor("specularFactor"), object("specularTexture", kTexture),
                               colour("specularColorFactor", 3, kMost), object("specularColorTexture", kTexture)};
constexpr Field kTransmission[] = {factor("transmissionFactor"), object("transmissionTexture", kTexture)};
constexpr Field kVolume[] = {factor("thicknessFactor", 0, kMost), object("thicknessTexture", kTexture),
                             colour("attenuationColor"), real("attenuationDistance")};
constexpr Field kVolumeScatter[] = {colour("multiscatterColorFactor"), colour("multiscatterColor"),
                                    object("multiscatterColorTexture", kTexture), factor("scatterAnisotropy", -1, 1)};
constexpr Field kDiffuseTransmission[] = {
    factor("diffuseTransmissionFactor"), object("diffuseTransmissionTexture", kTexture),
    colour("diffuseTransmissionColorFactor"), object("diffuseTransmissionColorTexture", kTexture)};
constexpr Field kClearcoat[] = {factor("clearcoatFactor"), object("clearcoatTexture", kTexture),
                                factor("clearcoatRoughnessFactor"), object("clearcoatRoughnessTexture", kTexture),
                                object("clearcoatNormalTexture", kTexture)};
constexpr Field kSheen[] = {colour("sheenColorFactor"), object("sheenColorTexture", kTexture),
                            factor("sheenRoughnessFactor"), object("sheenRoughnessTexture", kTexture)};
constexpr Field kAnisotropy[] = {factor("anisotropyStrength"), real("anisotropyRotation"),
                                 object("anisotropyTexture", kTexture)};
constexpr Field kIridescence[] = {factor("iridescenceFactor"),
                                  object("iridescenceTexture", kTexture),
                                  factor("iridescenceIor", 1, kMost),
                                  factor("iridescenceThicknessMinimum", 0, kMost),
                                  factor("iridescenceThicknessMaximum", 0, kMost),
                                  object("iridescenceThicknessTexture", kTexture)};
constexpr Field kMaterialExtensions[] = {object("KHR_materials_anisotropy", kAnisotropy),
                                         object("KHR_materials_clearcoat", kClearcoat),
                                         object("KHR_materials_diffuse_transmission", kDiffuseTransmission),
                                         object("KHR_materials_dispersion", kDispersion),
                                         object("KHR_materials_emissive_strength", kEmissiveStrength),
                                         object("KHR_materials_ior", kIor),
                                         object("KHR_materials_iridescence", kIridescence),
                                         object("KHR_materials_pbrSpecularGlossiness", kSpecularGlossiness),
                                         object("KHR_materials_sheen", kSheen),
                                         object("KHR_materials_specular", kSpecular),
                                         object("KHR_materials_transmission", kTransmission),
                                         object("KHR_materials_unlit", {}),
                                         object("KHR_materials_volume", kVolume),
                                         object("KHR_materials_volume_scatter", kVolumeScatter)};
constexpr Field kMaterial[] = {text("name"),
                               object("pbrMetallicRoughness", kMetallicRoughness),
                               object("normalTexture", kTexture),
                               object("occlusionTexture", kTexture),
                               object("emissiveTexture", kTexture),
                               colour("emissiveFactor", 3, kMost),
                               word("alphaMode", "OPAQUE, MASK, BLEND"),
                               factor("alphaCutoff", 0, kMost),
                               flag("doubleSided"),
                               object("extensions", kMaterialExtensions)};

constexpr Field kFallback[] = {flag("fallback")};
constexpr Field kBufferExtensions[] = {object("EXT_meshopt_compression", kFallback),
                                       object("KHR_meshopt_compression", kFallback)};
constexpr Field kBuffer[] = {text("name"),
                             text("uri"),
                             {.name = "byteLength",
                              .kind = Kind::Whole,
                              .high = kMostSize,
                              .mend = "write the size of the buffer in bytes",
                              .fallback = "9007199254740992",
                              .meanwhile = "all of its data is taken"},
                             object("extensions", kBufferExtensions)};
constexpr Field kMeshopt[] = {index("buffer", "buffers", "write the index of the buffer with the compressed data"),
                              whole("byteOffset", kMostSize),
                              whole("byteLength", kMostSize, "write the compressed size"),
                              whole("byteStride", 256, "write the size of one element"),
                              whole("count", kMostSize, "write the number of elements"),
                              word("mode", "ATTRIBUTES, TRIANGLES, INDICES", "write ATTRIBUTES, TRIANGLES or INDICES"),
                              word("filter", "NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL, COLOR")};
constexpr Field kViewExtensions[] = {object("EXT_meshopt_compression", kMeshopt),
                                     object("KHR_meshopt_compression", kMeshopt)};
constexpr Field kView[] = {index("buffer", "buffers", "write the index of a buffer", "-1"),
                           whole("byteOffset", kMostSize),
                           whole("byteLength", kMostSize, "write the size of the view in bytes", "0"),
                           whole("byteStride", 1 << 20), object("extensions", kViewExtensions)};
constexpr Field component(const char* mend) {
  return {.name = "componentType",
          .kind = Kind::Whole,
          .of = "5120, 5121, 5122, 5123, 5125 or 5126",
          .high = 65535,
          .mend = mend,
          .fallback = "5124",
          .meanwhile = kLeftOut};
}
constexpr Field wrap(const char* name) {
  return {.name = name,
          .kind = Kind::Whole,
          .of = "33071 (clamp), 33648 (mirror) or 10497 (repeat)",
          .high = 65535,
          .meanwhile = "it repeats"};
}
constexpr const char* kComponents = "write 5121 (bytes), 5123 (shorts), 5125 (ints) or 5126 (floats)";
// 5124, signed integers, is a type that nothing may have: it stands for one that is missing or unknown.
constexpr Field kSparseIndices[] = {index("bufferView", "bufferViews", "write the index of a bufferView"),
                                    whole("byteOffset", kMostInt), component(kComponents)};
constexpr Field kSparseValues[] = {index("bufferView", "bufferViews", "write the index of a bufferView"),
                                   whole("byteOffset", kMostInt)};
constexpr Field kSparse[] = {whole("count", kMostInt, "write the number of replaced elements"),
                             object("indices", kSparseIndices, "describe the replaced indices"),
                             object("values", kSparseValues, "describe the new values")};
constexpr const char* kNoSparse =
    R"({"count":0,"indices":{"bufferView":-2,"componentType":5124},"values":{"bufferView":-2}})";
// Likewise MAT2, as no attribute has this shape; -2 is a view that is missing, where -1 means zeros.
constexpr Field kAccessor[] = {index("bufferView", "bufferViews", nullptr, nullptr, "-2"),
                               whole("byteOffset", kMostSize),
                               whole("count", kMostSize, "write the number of elements", "0"),
                               component(kComponents),
                               flag("normalized"),
                               word("type", "SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3, MAT4",
                                    "write SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4", "\"MAT2\""),
                               {.name = "sparse", .kind = Kind::Object, .shape = kSparse, .ifWrong = kNoSparse}};

constexpr Field kImage[] = {text("name"), text("uri"), text("mimeType"), index("bufferView", "bufferViews")};
constexpr Field kSampler[] = {whole("magFilter", 65535), wrap("wrapS"), wrap("wrapT")};
constexpr Field kOtherImage[] = {index("source", "images")};
constexpr Field kTextureObjectExtensions[] = {object("EXT_texture_avif", kOtherImage),
                                              object("EXT_texture_webp", kOtherImage),
                                              object("KHR_texture_basisu", kOtherImage)};
constexpr Field kTextureObject[] = {index("source", "images"), index("sampler", "samplers"),
                                    object("extensions", kTextureObjectExtensions)};

constexpr Field kDraco[] = {
    index("bufferView", "bufferViews", "write the index of the bufferView with the compressed mesh"),
    {.name = "attributes",
     .kind = Kind::Map,
     .mend = "map attribute names to ids in the compressed mesh",
     .fallback = "{}"}};
constexpr Field kMapping[] = {index("material", "materials", "write the index of a material", "-1"),
                              indices("variants", "variants")};
constexpr Field kMappings[] = {list("mappings", kMapping)};
constexpr Field kPrimitiveExtensions[] = {object("KHR_draco_mesh_compression", kDraco),
                                          object("KHR_materials_variants", kMappings)};
constexpr Field kPrimitive[] = {map("attributes", "accessors", "write at least POSITION"),
                                index("indices", "accessors", nullptr, nullptr, "-2"),
                                index("material", "materials"),
                                {.name = "mode", .kind = Kind::Whole, .high = 6, .ifWrong = "-1"},
                                {.name = "targets", .kind = Kind::List, .of = "accessors"},
                                object("extensions", kPrimitiveExtensions)};
constexpr Field kMesh[] = {text("name"), reals("weights"),
                           list("primitives", kPrimitive, "write at least one primitive")};

constexpr Field kNodeLight[] = {index("light", "lights")};
constexpr Field kVisibility[] = {flag("visible")};
constexpr Field kInstancing[] = {map("attributes", "accessors")};
constexpr Field kNodeExtensions[] = {object("KHR_lights_punctual", kNodeLight),
                                     object("KHR_node_visibility", kVisibility),
                                     object("EXT_mesh_gpu_instancing", kInstancing)};
constexpr Field kNode[] = {text("name"),
                           indices("children", "nodes"),
                           reals("matrix", 16),
                           reals("translation", 3),
                           reals("rotation", 4),
                           reals("scale", 3),
                           reals("weights"),
                           index("mesh", "meshes"),
                           index("camera", "cameras"),
                           index("skin", "skins"),
                           object("extensions", kNodeExtensions)};
constexpr Field kSceneLight[] = {index("light", "image-based lights")};
constexpr Field kSceneExtensions[] = {object("EXT_lights_image_based", kSceneLight)};
constexpr Field kScene[] = {text("name"), indices("nodes", "nodes"), object("extensions", kSceneExtensions)};
constexpr Field kSkin[] = {indices("joints", "nodes", "list the nodes that move the skin"),
                           index("inverseBindMatrices", "accessors")};

constexpr Field kAnimationSampler[] = {index("input", "accessors", "write the accessor of the key times", "-1"),
                                       index("output", "accessors", "write the accessor of the key values", "-1"),
                                       word("interpolation", "LINEAR, STEP, CUBICSPLINE")};
constexpr Field kPointer[] = {text("pointer")};
constexpr Field kTargetExtensions[] = {object("KHR_animation_pointer", kPointer)};
constexpr Field kTarget[] = {{.name = "node", .kind = Kind::Index, .of = "nodes", .fallback = "-1"},
                             object("extensions", kTargetExtensions),
                             word("path", "translation, rotation, scale, weights, pointer",
                                  "write translation, rotation, scale or weights", "\"\"")};
constexpr Field kChannel[] = {index("sampler", "samplers of this animation", "write the index of a sampler", "-1"),
                              object("target", kTarget, "name the node and the property that move", "{}")};
constexpr Field kAnimation[] = {text("name"), list("samplers", kAnimationSampler), list("channels", kChannel)};

// tinygltf insists on clipping planes, which do not clip a path tracer.
constexpr Field kPerspective[] = {needed("yfov", "0.8", "write the vertical angle of view in radians"),
                                  real("aspectRatio"), needed("znear", "0.1")};
constexpr Field kOrthographic[] = {needed("xmag", "1", "write half the extent of the view in metres"),
                                   needed("ymag", "1", "write half the extent of the view in metres"),
                                   needed("znear", "0.1"), needed("zfar", "100")};
constexpr Field kCamera[] = {text("name"),
                             word("type", "perspective, orthographic", "write perspective or orthographic", "\"\""),
                             object("perspective", kPerspective), object("orthographic", kOrthographic)};

constexpr Field kSpot[] = {factor("innerConeAngle", 0, 1.5707963267948966),
                           factor("outerConeAngle", 1e-4, 1.5707963267948966)};
constexpr Field kLight[] = {
    text("name"),      word("type", "point, spot, directional", "write point, spot or directional", "\"point\""),
    reals("color", 3), factor("intensity", 0, kMost),
    real("range"),     object("spot", kSpot)};
constexpr Field kLights[] = {list("lights", kLight)};
constexpr Field kImageBasedLight[] = {text("name"),
                                      reals("rotation", 4),
                                      factor("intensity", 0, kMost),
                                      {.name = "irradianceCoefficients", .kind = Kind::RealRows, .count = 3},
                                      {.name = "specularImages", .kind = Kind::IndexRows, .of = "images", .count = 6}};
constexpr Field kImageBasedLights[] = {list("lights", kImageBasedLight)};
constexpr Field kVariant[] = {{.name = "name", .kind = Kind::Text, .fallback = "\"\""}};
constexpr Field kVariants[] = {list("variants", kVariant)};
constexpr Field kRootExtensions[] = {object("EXT_lights_image_based", kImageBasedLights),
                                     object("KHR_lights_punctual", kLights),
                                     object("KHR_materials_variants", kVariants)};

constexpr const char* kReadAs2 = "it is read as 2.0";
constexpr Field kAsset[] = {
    {.name = "version", .kind = Kind::Text, .mend = "write \"2.0\"", .fallback = "\"2.0\"", .meanwhile = kReadAs2},
    text("minVersion")};
constexpr Field kRoot[] = {{.name = "asset",
                            .kind = Kind::Object,
                            .shape = kAsset,
                            .mend = "write {\"version\": \"2.0\"}",
                            .fallback = R"({"version": "2.0"})",
                            .meanwhile = kReadAs2},
                           {.name = "extensionsUsed", .kind = Kind::Texts},
                           {.name = "extensionsRequired", .kind = Kind::Texts},
                           list("buffers", kBuffer),
                           list("bufferViews", kView),
                           list("accessors", kAccessor),
                           list("images", kImage),
                           list("samplers", kSampler),
                           list("textures", kTextureObject),
                           list("materials", kMaterial),
                           list("meshes", kMesh),
                           list("cameras", kCamera),
                           list("skins", kSkin),
                           list("nodes", kNode),
                           list("scenes", kScene),
                           list("animations", kAnimation),
                           index("scene", "scenes"),
                           object("extensions", kRootExtensions)};

}  // namespace

std::span<const Field> rootShape() { return kRoot; }

std::span<const Field> materialExtensions() { return kMaterialExtensions; }

}  // namespace braid::gltf
