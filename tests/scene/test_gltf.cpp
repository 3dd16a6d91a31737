// SPDX-License-Identifier: Apache-2.0
// Geometry from glTF: containers, accessors, triangulation, repairs, tangents, morphing and compression.
#include "tests/support/gltf_fixture.h"

#include <cmath>
#include <limits>

#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <meshoptimizer.h>

#include "renderer/scene/gltf/tangents.h"

namespace braid::test_gltf {

using namespace test;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

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

TriangleMesh onlyMesh(const SceneData& scene) {
  REQUIRE(scene.meshes.size() == 1);
  return scene.meshes[0];
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

TEST_CASE("gltf: triangles with positions that are not finite are dropped and counted") {
  GltfFile file = quadFile();
  file.primitive()["attributes"]["POSITION"] = file.accessor<float>({0, 0, 0, 1, kNan, 0, 1, 1, 0, 0, 1, 0}, "VEC3");
  const SceneData scene = file.load();
  CHECK(onlyMesh(scene).triangles.size() == 1);
  CHECK(onlyMesh(scene).positions.size() == 3);
  CHECK(hasWarning(scene, "not finite"));
}

TEST_CASE("gltf: unusable normals become geometric normals") {
  GltfFile file = quadFile();
  file.primitive()["attributes"]["NORMAL"] = file.accessor<float>({0, 0, 0, 1e-40f, 0, 0, kNan, 0, 1, 0, 0, 3}, "VEC3");
  const SceneData scene = file.load();
  for (const Vec3& n : onlyMesh(scene).normals) CHECK(n == Vec3(0, 0, 1));
  CHECK(hasWarning(scene, "normal is zero or not finite"));
  CHECK(hasWarning(scene, "(3 times)"));
}

TEST_CASE("gltf: vertex colours are clamped and may lack alpha") {
  GltfFile file = triangleFile();
  SUBCASE("RGB floats") {
    file.primitive()["attributes"]["COLOR_0"] = file.accessor<float>({2, 0.5f, -1, 0, 0, 0, kNan, 1, 1}, "VEC3");
    const TriangleMesh mesh = onlyMesh(file.load());
    CHECK(mesh.colors[0] == Vec4(1, 0.5f, 0, 1));
    CHECK(mesh.colors[2] == Vec4(0, 1, 1, 1));
  }
  SUBCASE("RGBA bytes") {
    file.primitive()["attributes"]["COLOR_0"] =
        file.accessor<uint8_t>({255, 0, 51, 255, 0, 0, 0, 0, 0, 0, 0, 102}, "VEC4", true);
    const TriangleMesh mesh = onlyMesh(file.load());
    CHECK(mesh.colors[0].z == doctest::Approx(0.2));
    CHECK(mesh.colors[2].w == doctest::Approx(0.4));
  }
}

TEST_CASE("gltf: attributes that nothing reads are not kept") {
  GltfFile file = quadFile();
  CHECK(onlyMesh(file.load()).uv[0].empty());
  LoadOptions options;
  options.keepAllAttributes = true;
  CHECK(onlyMesh(file.load(options)).uv[0].size() == 4);
  giveMaterial(file, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", addTexture(file)}}}}}});
  CHECK(onlyMesh(file.load()).uv[0].size() == 4);
  CHECK(onlyMesh(file.load()).tangents.empty());
}

TEST_CASE("gltf: tangents are computed for normal maps and follow u, with w for glTF's downward v") {
  GltfFile file = quadFile();
  giveMaterial(file, {{"normalTexture", {{"index", addTexture(file)}}}});
  SUBCASE("as authored") {
    const TriangleMesh mesh = onlyMesh(file.load());
    REQUIRE(mesh.tangents.size() == 4);
    for (const Vec4& t : mesh.tangents) CHECK(t == Vec4(1, 0, 0, 1));
  }
  SUBCASE("mirrored u") {
    file.primitive()["attributes"]["TEXCOORD_0"] = file.accessor<float>({1, 1, 0, 1, 0, 0, 1, 0}, "VEC2");
    for (const Vec4& t : onlyMesh(file.load()).tangents) CHECK(t == Vec4(-1, 0, 0, -1));
  }
  SUBCASE("supplied tangents are kept") {
    file.primitive()["attributes"]["TANGENT"] =
        file.accessor<float>({0, 2, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1}, "VEC4");
    for (const Vec4& t : onlyMesh(file.load()).tangents) CHECK(t == Vec4(0, 1, 0, -1));
  }
  SUBCASE("unusable tangents are replaced") {
    file.primitive()["attributes"]["TANGENT"] =
        file.accessor<float>({0, 0, 0, 1, 0, 1, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1}, "VEC4");
    const SceneData scene = file.load();
    for (const Vec4& t : onlyMesh(scene).tangents) CHECK(t == Vec4(1, 0, 0, 1));
    CHECK(hasWarning(scene, "tangent is zero"));
  }
  SUBCASE("without normals the faces are flat and supplied tangents ignored") {
    file.primitive()["attributes"].erase("NORMAL");
    file.primitive()["attributes"]["TANGENT"] =
        file.accessor<float>({0, 1, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1}, "VEC4");
    const TriangleMesh mesh = onlyMesh(file.load());
    CHECK(mesh.positions.size() == 6);
    for (const Vec3& n : mesh.normals) CHECK(n == Vec3(0, 0, 1));
    for (const Vec4& t : mesh.tangents) CHECK(t == Vec4(1, 0, 0, 1));
  }
  SUBCASE("without texture coordinates") {
    file.primitive()["attributes"].erase("TEXCOORD_0");
    const SceneData scene = file.load();
    CHECK(onlyMesh(scene).tangents.empty());
    CHECK(hasWarning(scene, "needs tangents"));
  }
}

TEST_CASE("tangents: vertices split where texture space is mirrored") {
  // Two triangles share the edge x = 0; u grows away from it on both sides.
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {-1, 0, 0}};
  mesh.normals.assign(4, Vec3(0, 0, 1));
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}};
  std::vector<std::vector<Vec2>> uv{{{0, 1}, {0, 0}, {1, 1}, {1, 1}}};
  mesh.uv[0] = uv[0];
  generateTangents(mesh, 0, uv);
  CHECK(mesh.positions.size() == 6);
  CHECK(uv[0].size() == 6);
  CHECK(mesh.uv[0].size() == 6);
  for (int k = 0; k < 3; ++k) {
    CHECK(mesh.tangents[mesh.triangles[0][k]] == Vec4(1, 0, 0, 1));
    CHECK(mesh.tangents[mesh.triangles[1][k]] == Vec4(-1, 0, 0, -1));
  }
}

TEST_CASE("tangents: equal vertices share a tangent, degenerate texture space still gives a unit frame") {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {0, 1, 0}, {-1, 0, 0}};
  mesh.normals.assign(6, Vec3(0, 0, 1));
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
  SUBCASE("welded") {
    std::vector<std::vector<Vec2>> uv{{{0, 1}, {1, 1}, {0, 0}, {0, 1}, {0, 0}, {-1, 0.5f}}};
    generateTangents(mesh, 0, uv);
    CHECK(mesh.tangents[0] == mesh.tangents[3]);
    CHECK(mesh.tangents[2] == mesh.tangents[4]);
  }
  SUBCASE("no texture space") {
    std::vector<std::vector<Vec2>> uv{std::vector<Vec2>(6, Vec2(0.5f))};
    generateTangents(mesh, 0, uv);
  }
  for (const Vec4& t : mesh.tangents) {
    CHECK(glm::length(Vec3(t)) == doctest::Approx(1));
    CHECK(std::abs(t.z) < 1e-6f);
  }
}

TEST_CASE("gltf: morph targets displace positions, normals and colours") {
  GltfFile file = quadFile();
  const int move = file.accessor<float>({0, 0, 2, 0, 0, 2, 0, 0, 2, 0, 0, 2}, "VEC3");
  const int turn = file.accessor<float>({2, 0, 0, 2, 0, 0, 2, 0, 0, 2, 0, 0}, "VEC3");
  file.primitive()["targets"] = {{{"POSITION", move}}, {{"NORMAL", turn}}};
  SUBCASE("no weights: nothing moves") { CHECK(onlyMesh(file.load()).positions[0] == Vec3(0)); }
  SUBCASE("weights of the mesh") {
    file.root["meshes"][0]["weights"] = {0.5, 0.5};
    const TriangleMesh mesh = onlyMesh(file.load());
    CHECK(mesh.positions[0] == Vec3(0, 0, 1));
    CHECK(mesh.normals[0].x == doctest::Approx(std::sqrt(0.5)));
  }
  SUBCASE("weights of the node come first, and two poses are two meshes") {
    file.root["meshes"][0]["weights"] = {0.5, 0};
    file.root["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}, {"weights", {1, 0}}}, {{"mesh", 0}}};
    file.root["scenes"][0]["nodes"] = {0, 1, 2};
    const SceneData scene = file.load();
    REQUIRE(scene.meshes.size() == 2);
    REQUIRE(scene.instances.size() == 3);
    CHECK(scene.meshes[0].positions[0].z == 1);
    CHECK(scene.meshes[1].positions[0].z == 2);
    CHECK(scene.instances[2].mesh == 0);
  }
}

TEST_CASE("gltf: Draco meshes") {
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(2);
  const int id = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const float a[3] = {0, 0, 0}, b[3] = {1, 0, 0}, c[3] = {1, 1, 0}, d[3] = {0, 1, 0};
  builder.SetAttributeValuesForFace(id, draco::FaceIndex(0), a, b, c);
  builder.SetAttributeValuesForFace(id, draco::FaceIndex(1), a, c, d);
  const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
  draco::EncoderBuffer encoded;
  REQUIRE(draco::Encoder().EncodeMeshToBuffer(*mesh, &encoded).ok());

  GltfFile file = quadFile();
  file.root["extensionsRequired"] = file.root["extensionsUsed"] = {"KHR_draco_mesh_compression"};
  const int view = file.view(std::vector<char>(encoded.data(), encoded.data() + encoded.size()));
  const int position = file.append("accessors", {{"componentType", 5126}, {"type", "VEC3"}, {"count", 4}});
  const int indices = file.append("accessors", {{"componentType", 5123}, {"type", "SCALAR"}, {"count", 6}});
  file.primitive() = {
      {"attributes", {{"POSITION", position}}},
      {"indices", indices},
      {"extensions", {{"KHR_draco_mesh_compression", {{"bufferView", view}, {"attributes", {{"POSITION", 0}}}}}}}};
  SUBCASE("decode") {
    const TriangleMesh decoded = onlyMesh(file.load());
    CHECK(decoded.triangles.size() == 2);
    CHECK(decoded.positions.size() == 4);
    Bounds bounds;
    for (const Vec3& p : decoded.positions) bounds.extend(p);
    CHECK(glm::length(bounds.lo) < 1e-3f);
    CHECK(glm::length(bounds.hi - Vec3(1, 1, 0)) < 1e-3f);
  }
  SUBCASE("broken data") {
    file.root["bufferViews"][static_cast<size_t>(view)]["byteLength"] = encoded.size() / 2;
    CHECK_ERROR(file, "cannot be decompressed");
  }
  SUBCASE("an attribute that is not there") {
    file.primitive()["extensions"]["KHR_draco_mesh_compression"]["attributes"]["POSITION"] = 9;
    CHECK_ERROR(file, "which the compressed mesh does not hold");
  }
}

TEST_CASE("gltf: meshopt compression with a fallback buffer that has no data") {
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  const std::vector<uint32_t> indices{0, 1, 2, 0, 2, 3};
  std::vector<uint8_t> packedVertices(meshopt_encodeVertexBufferBound(4, 12)),
      packedIndices(meshopt_encodeIndexBufferBound(6, 4));
  packedVertices.resize(
      meshopt_encodeVertexBuffer(packedVertices.data(), packedVertices.size(), positions.data(), 4, 12));
  meshopt_encodeIndexVersion(1);
  packedIndices.resize(meshopt_encodeIndexBuffer(packedIndices.data(), packedIndices.size(), indices.data(), 6));

  for (const std::string name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    CAPTURE(name);
    GltfFile file = quadFile();
    file.root["extensionsRequired"] = file.root["extensionsUsed"] = {name};
    const int v = file.view(packedVertices), i = file.view(packedIndices);
    const auto compress = [&](int source, Json extension, uint64_t offset, uint64_t length) {
      const Json raw = file.root["bufferViews"][static_cast<size_t>(source)];
      extension["buffer"] = 0;
      extension["byteOffset"] = raw["byteOffset"];
      extension["byteLength"] = raw["byteLength"];
      return file.append(
          "bufferViews",
          {{"buffer", 1}, {"byteOffset", offset}, {"byteLength", length}, {"extensions", {{name, extension}}}});
    };
    const int vertexView = compress(v, {{"byteStride", 12}, {"count", 4}, {"mode", "ATTRIBUTES"}}, 0, 48);
    const int indexView = compress(i, {{"byteStride", 2}, {"count", 6}, {"mode", "TRIANGLES"}}, 48, 12);
    file.root["buffers"] = {{{"byteLength", file.binary.size()}},
                            {{"byteLength", 60}, {"extensions", {{name, {{"fallback", true}}}}}}};
    const int p =
        file.append("accessors", {{"bufferView", vertexView}, {"componentType", 5126}, {"type", "VEC3"}, {"count", 4}});
    const int t = file.append("accessors",
                              {{"bufferView", indexView}, {"componentType", 5123}, {"type", "SCALAR"}, {"count", 6}});
    file.primitive() = {{"attributes", {{"POSITION", p}}}, {"indices", t}};
    const SceneData scene = file.load();
    CHECK(onlyMesh(scene).triangles.size() == 2);
    CHECK(onlyMesh(scene).positions[2] == Vec3(1, 1, 0));

    Json& extension = file.root["bufferViews"][static_cast<size_t>(vertexView)]["extensions"][name];
    extension["count"] = 1e9;
    CHECK_ERROR(file, "more than the view can hold");
    extension["count"] = 4;
    extension["byteLength"] = 5;
    CHECK_ERROR(file, "cannot be decompressed");
    extension["byteLength"] = 1e6;
    CHECK_ERROR(file, "correct byteOffset and byteLength");
  }
}

}  // namespace braid::test_gltf
