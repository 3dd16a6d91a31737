// SPDX-License-Identifier: Apache-2.0
// Containers and accessors of glTF, and triangles from them.
#include "tests/support/gltf_fixture.h"

namespace braid::test_gltf {

using namespace test;

namespace {

std::string base64(const std::string& data) {
  static const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (size_t i = 0; i < data.size(); i += 3) {
    uint32_t bits = 0;
    for (size_t k = 0; k < 3; ++k) bits = bits << 8 | (i + k < data.size() ? static_cast<uint8_t>(data[i + k]) : 0u);
    for (size_t k = 0; k < 4; ++k) out += i + k > data.size() ? '=' : digits[bits >> (18 - 6 * k) & 63];
  }
  return out;
}

// Five points of a zigzag: three triangles as a strip or as a fan.
GltfFile zigzag(int mode) {
  GltfFile file = triangleFile();
  const int position = file.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0}, "VEC3");
  file.primitive() = {{"attributes", {{"POSITION", position}}}, {"mode", mode}};
  return file;
}

}  // namespace

TEST_CASE("gltf: a GLB with one triangle that has no indices and no normals") {
  const SceneData scene = triangleFile().load();
  REQUIRE(scene.meshes.size() == 1);
  const TriangleMesh& mesh = scene.meshes[0];
  CHECK(mesh.positions.size() == 3);
  REQUIRE(mesh.triangles.size() == 1);
  CHECK(mesh.triangles[0] == glm::uvec3(0, 1, 2));
  CHECK(mesh.normals.empty());
  CHECK(mesh.positions.capacity() > mesh.positions.size());
  REQUIRE(scene.instances.size() == 1);
  REQUIRE(scene.materials.size() == 1);
  CHECK(scene.materials[0].metallic == 1);
  CHECK(scene.materials[0].roughness == 1);
}

TEST_CASE("gltf: containers in unusual but legal shapes") {
  GltfFile file = triangleFile();
  file.root["buffers"] = {{{"byteLength", file.binary.size()}}};
  const std::string json = chunk(kJsonChunk, file.root.dump(), ' '), binary = chunk(kBinaryChunk, file.binary, '\0');
  const Folder folder;
  SUBCASE("an unknown chunk between and after") {
    const std::string unknown = chunk(0x12345678, "abcdefg", 'x');
    CHECK(loadGltf(folder.write("a.glb", glbOf(json + unknown + binary + unknown))).meshes.size() == 1);
  }
  SUBCASE("bytes after the end") {
    const SceneData scene = loadGltf(folder.write("a.glb", glbOf(json + binary) + "tail"));
    CHECK(hasWarning(scene, "bytes after the end"));
  }
  SUBCASE("a byte order mark") {
    file.root["buffers"][0]["uri"] = "a.bin";
    folder.write("a.bin", file.binary);
    const SceneData scene = loadGltf(folder.write("a.gltf", "\xEF\xBB\xBF" + file.root.dump()));
    CHECK(hasWarning(scene, "byte order mark"));
  }
  SUBCASE("an empty binary chunk") {
    const std::string bare = R"({"asset":{"version":"2.0"}})";
    const SceneData scene =
        loadGltf(folder.write("a.glb", glbOf(chunk(kJsonChunk, bare, ' ') + chunk(kBinaryChunk, "", '\0'))));
    CHECK(scene.meshes.empty());
    CHECK(hasWarning(scene, "no triangles"));
  }
}

TEST_CASE("gltf: buffers by relative, escaped and data URIs") {
  GltfFile file = triangleFile();
  file.root["buffers"] = {{{"byteLength", file.binary.size()}}};
  const Folder folder;
  const auto loads = [&](const std::string& uri) {
    file.root["buffers"][0]["uri"] = uri;
    return loadGltf(folder.write("a.gltf", file.root.dump())).meshes.size() == 1;
  };
  folder.write("my data/tri angle.bin", file.binary);
  CHECK(loads("my%20data/tri%20angle.bin"));
  CHECK(loads("my data/tri angle.bin"));
  CHECK(loads("./my data/../my data/tri angle.bin"));
  CHECK(loads("my data\\tri angle.bin"));
  CHECK(loads("data:application/octet-stream;base64," + base64(file.binary)));
  std::string escaped;
  for (const char c : file.binary) {
    static const char* digits = "0123456789abcdef";
    escaped += {'%', digits[static_cast<uint8_t>(c) >> 4], digits[static_cast<uint8_t>(c) & 15]};
  }
  CHECK(loads("data:," + escaped));
}

TEST_CASE("gltf: the content hash covers every referenced byte") {
  GltfFile file = triangleFile();
  const uint64_t original = file.load().contentHash;
  CHECK(file.load().contentHash == original);
  file.binary[0] = 1;
  CHECK(file.load().contentHash != original);
  file.binary[0] = 0;
  file.root["asset"]["generator"] = "x";
  CHECK(file.load().contentHash != original);
}

TEST_CASE("gltf: strips alternate their winding, fans share their first vertex") {
  const std::vector<glm::uvec3> strip = onlyMesh(zigzag(5).load()).triangles;
  CHECK(strip == std::vector<glm::uvec3>{{0, 1, 2}, {1, 3, 2}, {2, 3, 4}});
  const std::vector<glm::uvec3> fan = onlyMesh(zigzag(6).load()).triangles;
  CHECK(fan == std::vector<glm::uvec3>{{1, 2, 0}, {2, 3, 0}, {3, 4, 0}});
}

TEST_CASE("gltf: points and lines are skipped with a warning") {
  for (const int mode : {0, 1, 2, 3}) {
    const SceneData scene = zigzag(mode).load();
    CHECK(scene.meshes.empty());
    CHECK(scene.instances.empty());
    CHECK(hasWarning(scene, "points and lines"));
  }
}

TEST_CASE("gltf: indices of one, two and four bytes") {
  GltfFile file = quadFile();
  SUBCASE("bytes") { file.primitive()["indices"] = file.accessor<uint8_t>({0, 1, 2, 0, 2, 3}, "SCALAR"); }
  SUBCASE("shorts") {}
  SUBCASE("ints") { file.primitive()["indices"] = file.accessor<uint32_t>({0, 1, 2, 0, 2, 3}, "SCALAR"); }
  const SceneData scene = file.load();
  CHECK(onlyMesh(scene).triangles == std::vector<glm::uvec3>{{0, 1, 2}, {0, 2, 3}});
}

TEST_CASE("gltf: interleaved attributes") {
  GltfFile file = triangleFile();
  const int view = file.view<float>({0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 0, 1, 0, 3, 0, 0, 0, 1}, 24);
  const int position =
      file.append("accessors", {{"bufferView", view}, {"componentType", 5126}, {"type", "VEC3"}, {"count", 3}});
  const int normal = file.append(
      "accessors", {{"bufferView", view}, {"byteOffset", 12}, {"componentType", 5126}, {"type", "VEC3"}, {"count", 3}});
  file.primitive()["attributes"] = {{"POSITION", position}, {"NORMAL", normal}};
  const SceneData scene = file.load();
  CHECK(onlyMesh(scene).positions[2] == Vec3(0, 3, 0));
  CHECK(onlyMesh(scene).normals[1] == Vec3(0, 0, 1));
}

TEST_CASE("gltf: sparse accessors, with and without base data") {
  GltfFile file = triangleFile();
  const Json sparse = {{"count", 2},
                       {"indices", {{"bufferView", file.view<uint16_t>({0, 2})}, {"componentType", 5123}}},
                       {"values", {{"bufferView", file.view<float>({5, 5, 5, 7, 7, 7})}}}};
  SUBCASE("base data") {
    file.root["accessors"][0]["sparse"] = sparse;
    CHECK(onlyMesh(file.load()).positions == std::vector<Vec3>{{5, 5, 5}, {1, 0, 0}, {7, 7, 7}});
  }
  SUBCASE("zeros") {
    file.root["accessors"][0] = {{"componentType", 5126}, {"type", "VEC3"}, {"count", 3}, {"sparse", sparse}};
    CHECK(onlyMesh(file.load()).positions == std::vector<Vec3>{{5, 5, 5}, {0, 0, 0}, {7, 7, 7}});
  }
  SUBCASE("few of many vertices are read") {
    Json& accessor = file.root["accessors"][0];
    accessor = {{"componentType", 5126}, {"type", "VEC3"}, {"count", 100000}, {"sparse", sparse}};
    file.primitive()["indices"] = file.accessor<uint32_t>({0, 99999, 2}, "SCALAR");
    CHECK(onlyMesh(file.load()).positions == std::vector<Vec3>{{5, 5, 5}, {7, 7, 7}, {0, 0, 0}});
    CHECK(onlyMesh(file.load()).triangles == std::vector<glm::uvec3>{{0, 2, 1}});
  }
}

TEST_CASE("gltf: quantized positions, normals and texture coordinates") {
  GltfFile file = quadFile();
  file.root["extensionsRequired"] = file.root["extensionsUsed"] = {"KHR_mesh_quantization"};
  Json& attributes = file.primitive()["attributes"];
  // Each vertex is padded to 8 bytes, as the alignment rules demand.
  const int view = file.view<int16_t>({0, 0, 0, 0, 32767, 0, 0, 0, 32767, -32768, 0, 0, 0, 32767, 0, 0}, 8);
  attributes["POSITION"] = file.append(
      "accessors",
      {{"bufferView", view}, {"componentType", 5122}, {"normalized", true}, {"type", "VEC3"}, {"count", 4}});
  const int normals = file.view<int8_t>({0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127, 0}, 4);
  attributes["NORMAL"] = file.append(
      "accessors",
      {{"bufferView", normals}, {"componentType", 5120}, {"normalized", true}, {"type", "VEC3"}, {"count", 4}});
  attributes["TEXCOORD_0"] = file.accessor<uint16_t>({0, 0, 2, 0, 2, 2, 0, 2}, "VEC2");
  LoadOptions options;
  options.keepAllAttributes = true;
  const SceneData scene = file.load(options);
  CHECK(onlyMesh(scene).positions[1] == Vec3(1, 0, 0));
  CHECK(onlyMesh(scene).positions[2] == Vec3(1, -1, 0));
  CHECK(onlyMesh(scene).normals[0] == Vec3(0, 0, 1));
  CHECK(onlyMesh(scene).uv[0][2] == Vec2(2, 2));
}

TEST_CASE("gltf: vertices that no triangle uses are dropped") {
  GltfFile file = quadFile();
  file.primitive()["indices"] = file.accessor<uint16_t>({1, 2, 3}, "SCALAR");
  const SceneData scene = file.load();
  CHECK(onlyMesh(scene).positions == std::vector<Vec3>{{1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
  CHECK(onlyMesh(scene).normals.size() == 3);
  CHECK(onlyMesh(scene).triangles[0] == glm::uvec3(0, 1, 2));
}

}  // namespace braid::test_gltf
