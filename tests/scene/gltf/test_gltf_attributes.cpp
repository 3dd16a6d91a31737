// SPDX-License-Identifier: Apache-2.0
// Attributes of glTF geometry: repairs, colours, tangents and morphing.
#include "tests/support/gltf_fixture.h"

#include <cmath>
#include <limits>

#include "renderer/scene/gltf/tangents.h"

namespace braid::test_gltf_attributes {

using namespace test;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

}  // namespace

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

}  // namespace braid::test_gltf_attributes
