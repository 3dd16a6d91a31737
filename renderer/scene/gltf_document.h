// SPDX-License-Identifier: Apache-2.0
// A glTF file as plain structs: JSON read and type-checked, references resolved to indices, buffers in memory.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "renderer/core/hash.h"
#include "renderer/scene/gltf_json.h"
#include "renderer/scene/scene_data.h"

namespace braid::gltf {

using Bytes = std::span<const uint8_t>;

struct Buffer {
  Bytes data;
  std::vector<uint8_t> owned;    // empty for the binary chunk of a GLB, which stays in the file's bytes
  bool meshoptFallback = false;  // holds no data; every view of it is compressed elsewhere
};

enum class MeshoptMode : uint8_t { Attributes, Triangles, Indices };
enum class MeshoptFilter : uint8_t { None, Octahedral, Quaternion, Exponential };

struct MeshoptView {
  uint32_t buffer = kNone;
  uint64_t offset = 0, length = 0, stride = 0, count = 0;
  MeshoptMode mode = MeshoptMode::Attributes;
  MeshoptFilter filter = MeshoptFilter::None;
};

struct BufferView {
  uint32_t buffer = kNone;
  uint64_t offset = 0, length = 0, stride = 0;  // stride 0: tightly packed
  std::optional<MeshoptView> meshopt;
  std::vector<uint8_t> decoded;  // of a compressed view
  Bytes data;                    // filled once the buffers are read; empty if the view is broken
  bool valid = false;
};

enum class Component : uint16_t { I8 = 5120, U8 = 5121, I16 = 5122, U16 = 5123, U32 = 5125, F32 = 5126 };

struct SparseAccessor {
  uint64_t count = 0;
  uint32_t indexView = kNone, valueView = kNone;
  uint64_t indexOffset = 0, valueOffset = 0;
  Component indexType = Component::U16;
};

struct Accessor {
  uint32_t view = kNone;  // none: zeros
  uint64_t offset = 0, count = 0;
  Component component = Component::F32;
  bool normalized = false;
  uint8_t rows = 1, columns = 1;  // VECn: n x 1, MATn: n x n
  std::optional<SparseAccessor> sparse;
  bool valid = false;  // every element lies inside its view

  uint32_t components() const { return uint32_t(rows) * columns; }
};

struct DracoPrimitive {
  uint32_t view = kNone;
  std::map<std::string, uint32_t> ids;  // attribute name to the id inside the compressed mesh
};

using Attributes = std::map<std::string, uint32_t>;  // name to accessor

struct Primitive {
  std::string pointer;
  Attributes attributes;
  std::vector<Attributes> targets;
  uint32_t indices = kNone;
  uint32_t material = kNone;
  uint64_t mode = 4;
  std::vector<std::pair<uint32_t, uint32_t>> variantMaterials;  // variant, material
  std::optional<DracoPrimitive> draco;
};

struct Mesh {
  std::string name;
  std::vector<Primitive> primitives;
  std::vector<float> weights;
};

struct Node {
  std::string name;
  std::vector<uint32_t> children;
  uint32_t parent = kNone;
  std::optional<glm::dmat4> matrix;
  glm::dvec3 translation{0}, scale{1};
  glm::dquat rotation{1, 0, 0, 0};
  uint32_t mesh = kNone, skin = kNone, camera = kNone, light = kNone;
  std::optional<std::vector<float>> weights;
  bool visible = true;
  Attributes instancing;  // EXT_mesh_gpu_instancing
};

struct Skin {
  std::vector<uint32_t> joints;
  uint32_t inverseBindMatrices = kNone;
};

enum class Interpolation : uint8_t { Step, Linear, Cubic };
enum class AnimatedPath : uint8_t { Translation, Rotation, Scale, Weights };

struct AnimationChannel {
  std::string pointer;
  uint32_t node = kNone, input = kNone, output = kNone;
  Interpolation interpolation = Interpolation::Linear;
  AnimatedPath path = AnimatedPath::Translation;
};

struct Animation {
  std::string name;
  std::vector<AnimationChannel> channels;
};

struct ImageSource {
  std::string name, uri, mimeType;
  uint32_t view = kNone;
};

struct TextureSource {
  uint32_t image = kNone;
  Wrap wrapU = Wrap::Repeat, wrapV = Wrap::Repeat;
  Filter filter = Filter::Linear;
};

struct SceneSource {
  std::string name;
  std::vector<uint32_t> nodes;
};

// Texture references of materials hold the indices and uv sets of the file.
struct Document {
  std::string path, folder;
  bool allowExternal = false;  // links may lead out of the folder
  std::vector<uint8_t> bytes;  // the whole file
  Bytes json, binary;          // parts of `bytes`
  std::shared_ptr<const nlohmann::json> root;
  Report report;
  ContentHash hash;

  std::vector<std::string> extensionsUsed, extensionsRequired, extensionsIgnored;
  std::vector<std::string> variants;
  std::vector<Buffer> buffers;
  std::vector<BufferView> views;
  std::vector<Accessor> accessors;
  std::vector<Mesh> meshes;
  std::vector<Node> nodes;
  std::vector<Skin> skins;
  std::vector<Animation> animations;
  std::vector<CameraData> cameras;
  std::vector<PunctualLight> lights;
  std::vector<Material> materials;
  std::vector<TextureSource> textures;
  std::vector<ImageSource> images;
  std::vector<SceneSource> scenes;
  uint32_t defaultScene = kNone;

  // Bytes of the file itself plus all buffers: decoded data may only be so many times larger.
  uint64_t sourceBytes() const;
};

// gltf_container.cpp: reads the file, splits a GLB and parses the JSON; throws on the first problem, as nothing can
// follow it.
void readContainer(Document& document, const std::string& path);
// The bytes a relative or data URI stands for. On failure nothing, and the reason in `reason`.
std::optional<std::vector<uint8_t>> readUri(const Document& document, const std::string& uri, std::string& reason);
void readBuffers(Document& document);
// gltf_views.cpp: places every view inside its buffer and decompresses meshopt views.
void resolveViews(Document& document);

// gltf_parse.cpp, gltf_parse_scene.cpp, gltf_material.cpp: JSON to structs.
void checkExtensions(Document& document, const JsonRef& root);
void parseData(Document& document, const JsonRef& root);
void parseMeshes(Document& document, const JsonRef& root);
void parseNodes(Document& document, const JsonRef& root);
void parseAnimations(Document& document, const JsonRef& root);
void parseCamerasAndLights(Document& document, const JsonRef& root);
void parseMaterials(Document& document, const JsonRef& root);

// validate.cpp: everything that spans several objects.
void validate(Document& document);

}  // namespace braid::gltf
