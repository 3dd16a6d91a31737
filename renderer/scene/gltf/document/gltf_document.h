// SPDX-License-Identifier: Apache-2.0
// A glTF file in memory: the model that tinygltf makes of its checked JSON, the bytes behind it, and what is wrong with
// it.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

// Images are OpenImageIO's, files our own.
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_FS
#include <tiny_gltf.h>

#include "renderer/core/hash.h"
#include "renderer/scene/data/gltf.h"
#include "renderer/scene/data/textures/ktx2_image.h"
#include "renderer/scene/gltf/document/gltf_files.h"
#include "renderer/scene/gltf/document/gltf_report.h"
#include "renderer/scene/data/scene_data.h"

namespace braid::gltf {

using tinygltf::Accessor;
using tinygltf::Primitive;
using tinygltf::Value;
using Bytes = std::span<const uint8_t>;
using Attributes = std::map<std::string, int>;  // name to accessor

// "No index" of what this loader numbers itself; tinygltf's is -1.
inline constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// A bufferView's bytes, decompressed where it is packed. Shorter than it should be, or empty, where data is missing.
struct View {
  Bytes data;
  std::vector<uint8_t> decoded;
  uint64_t stride = 0;  // 0: tightly packed
};

// Where the pixels of an image are: in a view, or behind a URI.
struct ImageSource {
  std::string name, uri;
  int view = -1;
};

// The pixels of an image, from when they are first needed.
struct DecodedImage {
  bool done = false;
  std::vector<uint8_t> file;  // of an external image
  Bytes encoded;
  std::shared_ptr<const Image> image;
  std::optional<Ktx2Facts> ktx2;  // if it is a KTX2 texture
  std::string problem, note;
};

// A property that a clip moves and that is no node's place: KHR_animation_pointer.
struct AnimatedProperty {
  int clip = 0, channel = 0;
  std::string pointer;
  size_t width = 1;  // numbers of a value
  double low = 0, high = 0;
  int visibleNode = -1;  // KHR_node_visibility of this node; the pointer is not needed
};

struct Document {
  std::string path;
  LoadOptions options;
  Files files;
  Bytes json;  // its text, while it is read
  tinygltf::Model model;
  std::set<int> bareBuffers;  // those that name no data
  std::vector<View> views;
  std::vector<ImageSource> images;
  std::vector<DecodedImage> decoded;  // of the images, or still empty
  std::vector<Material> materials;    // texture references hold the indices and uv sets of the file
  std::vector<CameraData> cameras;    // both without their nodes' transforms
  std::vector<PunctualLight> lights;
  std::optional<EnvironmentData> environment;  // of the scene's image-based light
  std::vector<int> parents;                    // of the nodes
  // What pointers of animations lead to, and the checked JSON of materials, cameras and lights; null: nothing does.
  std::vector<AnimatedProperty> properties;
  std::shared_ptr<const nlohmann::json> animatable;
  // Accessors that primitives name but that cannot be read.
  std::map<const Primitive*, std::vector<int>> unreadable;
  std::vector<std::string> variants, extensionsIgnored;
  FilePartCounts parts{};
  Report report;
  Usage usage;
  ContentHash hash;
  // Bytes of the file itself plus all buffers: decoded data may only be so many times larger.
  uint64_t sourceBytes = 0;

  const Accessor& accessor(int index) const { return model.accessors[static_cast<size_t>(index)]; }
  void count(FilePart part, uint64_t number = 1) { parts[static_cast<size_t>(part)] += number; }
  // Marks an accessor as used, with its views and their buffers.
  void useAccessor(int index);
  void useView(int index);
};

// gltf_document.cpp: reads and checks a file. Throws SceneError where nothing can follow: no glTF 2, unsafe, or a
// required extension that is unknown.
void readDocument(Document& document, const std::string& path);

// tinygltf.cpp: what tinygltf makes of one object.
void parseNode(const nlohmann::json& json, tinygltf::Node& node);
void parseMaterial(const nlohmann::json& json, tinygltf::Material& material);
void parseCamera(const nlohmann::json& json, tinygltf::Camera& camera);
void parseLight(const nlohmann::json& json, tinygltf::Light& light);

// gltf_views.cpp: places every view inside its buffer and decompresses meshopt views.
void resolveViews(Document& document);
// gltf_material.cpp, gltf_optics.cpp: plain data; what is out of range is reported and replaced.
void readMaterials(Document& document);
void readCamerasAndLights(Document& document);
void readImageBasedLight(Document& document);
Material readMaterial(Document& document, const tinygltf::Material& source, size_t index);
CameraData readCamera(Document& document, const tinygltf::Camera& source, size_t index);
PunctualLight readLight(Document& document, const tinygltf::Light& source, size_t index);
// validate.cpp: what spans several objects. Afterwards every accessor is safe to read (broken ones have no elements)
// and nodes form trees.
void validate(Document& document);

// Members of an extension; the fallback where it, or the member, is absent.
const Value& member(const tinygltf::ExtensionMap& extensions, const char* name);
const Value& member(const Value& object, const char* name);
double number(const Value& object, const char* name, double fallback);
int index(const Value& object, const char* name);

}  // namespace braid::gltf
