// SPDX-License-Identifier: Apache-2.0
// Builds small glTF files for tests: JSON by hand, binary data appended to one buffer.
#pragma once

#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "renderer/core/error.h"
#include "renderer/scene/data/gltf.h"

namespace braid::test {

using Json = nlohmann::json;
namespace fs = std::filesystem;

// A folder that goes away with the test.
struct Folder {
  fs::path path;
  Folder() {
    static int count = 0;
    path =
        fs::temp_directory_path() / ("braid-test-gltf-" + std::to_string(::getpid()) + '-' + std::to_string(count++));
    fs::create_directories(path);
  }
  ~Folder() { fs::remove_all(path); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string write(const std::string& name, const std::string& bytes) const {
    fs::create_directories((path / name).parent_path());
    std::ofstream(path / name, std::ios::binary) << bytes;
    return (path / name).string();
  }
};

inline std::string chunk(uint32_t kind, std::string data, char padding) {
  while (data.size() % 4 != 0) data += padding;
  const auto size = static_cast<uint32_t>(data.size());
  std::string out(8, '\0');
  std::memcpy(&out[0], &size, 4);
  std::memcpy(&out[4], &kind, 4);
  return out + data;
}

inline std::string glbOf(const std::string& chunks) {
  const uint32_t header[3] = {0x46546C67, 2, static_cast<uint32_t>(chunks.size() + 12)};
  return std::string(reinterpret_cast<const char*>(header), 12) + chunks;
}

inline constexpr uint32_t kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;

class GltfFile {
 public:
  Json root = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", {0}}}}}};
  std::string binary;

  template <class T>
  int view(const std::vector<T>& values, int stride = 0) {
    while (binary.size() % 4 != 0) binary += '\0';
    const size_t offset = binary.size();
    binary.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    Json v = {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", values.size() * sizeof(T)}};
    if (stride != 0) v["byteStride"] = stride;
    return append("bufferViews", v);
  }

  // `type` is SCALAR, VEC2, …; the component type follows from T.
  template <class T>
  int accessor(const std::vector<T>& values, const std::string& type, bool normalized = false) {
    Json a = {{"bufferView", view(values)}, {"componentType", componentType<T>()}, {"type", type}};
    a["count"] = values.size() / components(type);
    if (normalized) a["normalized"] = true;
    return append("accessors", a);
  }

  int append(const std::string& array, const Json& entry) {
    root[array].push_back(entry);
    return static_cast<int>(root[array].size()) - 1;
  }

  // A node 0 that shows mesh 0.
  void show() {
    if (!root.contains("nodes")) root["nodes"] = {{{"mesh", 0}}};
  }

  Json& primitive(size_t index = 0) { return root["meshes"][0]["primitives"][index]; }
  Json& node(size_t index = 0) { return root["nodes"][index]; }

  std::string glb() const {
    Json j = root;
    if (!binary.empty() && !j.contains("buffers")) j["buffers"] = {{{"byteLength", binary.size()}}};
    const std::string text = chunk(kJsonChunk, j.dump(), ' ');
    return glbOf(text + (binary.empty() ? "" : chunk(kBinaryChunk, binary, '\0')));
  }

  static LoadOptions plainLight() {
    LoadOptions options;
    options.defaultLight = DefaultLight::Dome;
    return options;
  }

  SceneData load(const LoadOptions& options = plainLight()) const {
    const Folder folder;
    return loadGltf(folder.write("scene.glb", glb()), options);
  }

  template <class T>
  static int componentType() {
    if (std::is_same_v<T, int8_t>) return 5120;
    if (std::is_same_v<T, uint8_t>) return 5121;
    if (std::is_same_v<T, int16_t>) return 5122;
    if (std::is_same_v<T, uint16_t>) return 5123;
    if (std::is_same_v<T, uint32_t>) return 5125;
    return 5126;
  }
  static size_t components(const std::string& type) {
    if (type == "MAT4") return 16;
    return type == "SCALAR" ? 1 : static_cast<size_t>(type[3] - '0');
  }
};

// One triangle in the plane z = 0: (0,0), (1,0), (0,1).
inline GltfFile triangleFile() {
  GltfFile file;
  const int position = file.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  file.root["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", position}}}}}}}};
  file.show();
  return file;
}

// A unit square of two triangles with indices, normals +Z and texture coordinates.
inline GltfFile quadFile() {
  GltfFile file;
  const int position = file.accessor<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3");
  const int normal = file.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int uv = file.accessor<float>({0, 1, 1, 1, 1, 0, 0, 0}, "VEC2");
  const int indices = file.accessor<uint16_t>({0, 1, 2, 0, 2, 3}, "SCALAR");
  file.root["meshes"] = {
      {{"primitives",
        {{{"attributes", {{"POSITION", position}, {"NORMAL", normal}, {"TEXCOORD_0", uv}}}, {"indices", indices}}}}}};
  file.show();
  return file;
}

// A material of the file that primitive 0 uses.
inline void giveMaterial(GltfFile& file, const Json& material) {
  file.primitive()["material"] = file.append("materials", material);
}

// One RGB pixel: 10, 200, 30.
inline const std::vector<uint8_t>& tinyPng() {
  static const std::vector<uint8_t> bytes{
      0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
      0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00, 0x00, 0x90, 0x77, 0x53, 0xde, 0x00, 0x00, 0x00,
      0x0c, 0x49, 0x44, 0x41, 0x54, 0x78, 0xda, 0x63, 0xe0, 0x3a, 0x21, 0x07, 0x00, 0x01, 0xd0, 0x00, 0xf1, 0x1a,
      0xa1, 0x42, 0x58, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
  return bytes;
}

// A texture of that pixel, with an image of its own.
inline int addTexture(GltfFile& file) {
  const int image = file.append("images", {{"bufferView", file.view(tinyPng())}, {"mimeType", "image/png"}});
  return file.append("textures", {{"source", image}});
}

inline bool hasWarning(const SceneData& scene, const std::string& part) {
  for (const std::string& w : scene.warnings) {
    if (w.find(part) != std::string::npos) return true;
  }
  return false;
}

// The text of the error that loading throws; empty if it succeeds.
template <class Load>
std::string errorOf(const Load& load, ExitCode code = ExitCode::BadInput) {
  try {
    load();
  } catch (const SceneError& error) {
    CHECK(error.code() == code);
    return error.what();
  }
  return {};
}

// The same of a file with --strict, which refuses every problem.
inline std::string errorOf(const GltfFile& file, LoadOptions options = {}) {
  options.strict = true;
  return errorOf([&] { file.load(options); });
}

#define CHECK_ERROR(file, part)                   \
  do {                                            \
    const std::string text = test::errorOf(file); \
    INFO("error: ", text);                        \
    CHECK(text.find(part) != std::string::npos);  \
  } while (false)

inline TriangleMesh onlyMesh(const SceneData& scene) {
  REQUIRE(scene.meshes.size() == 1);
  return scene.meshes[0];
}

}  // namespace braid::test
