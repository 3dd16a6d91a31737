// SPDX-License-Identifier: Apache-2.0
// Geometry of a flawed file: what cannot be read of buffers, accessors, primitives, attributes and skins is left out,
// and a warning names it; the rest is drawn.
#include "tests/scene/gltf/gltf_lenient.h"
#include "tests/support/gltf_fixture.h"

namespace braid::test_gltf_lenient_meshes {

using namespace test;
using namespace test::gltf_lenient;

namespace {

// A second triangle beside the first one, each a primitive of its own.
GltfFile twoTriangles() {
  GltfFile file = triangleFile();
  const int position = file.accessor<float>({5, 0, 0, 6, 0, 0, 5, 1, 0}, "VEC3");
  file.root["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", position}}}});
  return file;
}

float x(const SceneData& scene) { return scene.meshes.at(0).positions.at(0).x; }

void checkSecondDrawn(const GltfFile& file, const std::string& warning) {
  const SceneData scene = loadWarned(file, warning);
  REQUIRE(scene.meshes.size() == 1);
  CHECK(x(scene) == 5);
}

}  // namespace

TEST_CASE("lenient: a primitive whose accessor cannot be read is skipped, others are drawn") {
  GltfFile file = twoTriangles();
  Json& accessor = file.root["accessors"][0];
  std::string warning;
  SUBCASE("count beyond the view") {
    accessor["count"] = 4;
    warning = "/accessors/0: needs 4 elements";
  }
  SUBCASE("no such view") {
    accessor["bufferView"] = 9;
    warning = "/accessors/0/bufferView: is 9, but bufferViews end at 1";
  }
  SUBCASE("no type") {
    accessor.erase("type");
    warning = "/accessors/0/type: is missing";
  }
  SUBCASE("another shape") {
    accessor["type"] = "VEC2";
    warning = "/meshes/0/primitives/0/attributes/POSITION: accessor 0 has the wrong type";
  }
  SUBCASE("sparse indices out of order") {
    const int indices = file.view<uint8_t>({2, 1}), values = file.view<float>({0, 0, 0, 0, 0, 0});
    accessor["sparse"] = {{"count", 2},
                          {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
                          {"values", {{"bufferView", values}}}};
    warning = "/accessors/0/sparse/indices: must increase";
  }
  SUBCASE("a sparse accessor that is none") {
    accessor["sparse"] = "yes";
    warning = "/accessors/0/sparse: is the text 'yes'; it must be an object";
  }
  checkSecondDrawn(file, warning);
}

TEST_CASE("lenient: a primitive that names what is not there is skipped, others are drawn") {
  GltfFile file = twoTriangles();
  std::string warning;
  SUBCASE("no such accessor") {
    file.primitive()["attributes"]["POSITION"] = 7;
    warning = "/meshes/0/primitives/0/attributes/POSITION: is 7, but accessors end at 1";
  }
  SUBCASE("unknown mode") {
    file.primitive()["mode"] = 7;
    warning = "/meshes/0/primitives/0/mode: is 7";
  }
  SUBCASE("indices that are no indices") {
    file.primitive()["indices"] = file.accessor<float>({0, 1, 2}, "SCALAR");
    warning = "/meshes/0/primitives/0/indices: accessor 2 has the wrong type";
  }
  SUBCASE("indices out of bounds") {
    file.primitive()["indices"] = 9;
    warning = "/meshes/0/primitives/0/indices: is 9, but accessors end at 1";
  }
  checkSecondDrawn(file, warning);
}

TEST_CASE("lenient: a truncated buffer keeps what lies inside") {
  GltfFile file = twoTriangles();
  file.root["buffers"] = {{{"byteLength", file.binary.size()}}};
  file.root["bufferViews"][0]["byteLength"] = file.binary.size();
  file.root["accessors"][1]["bufferView"] = 0;
  file.root["accessors"][1]["byteOffset"] = 36;
  file.binary.resize(40);
  const SceneData scene = loadWarned(file, "/buffers/0/byteLength: is 72, but the data has 40 bytes: it is truncated");
  REQUIRE(scene.meshes.size() == 1);
  CHECK(x(scene) == 0);
  CHECK(hasWarning(scene, "/accessors/1: needs 3 elements"));
}

TEST_CASE("lenient: a GLB that is cut keeps what is there") {
  const GltfFile file = twoTriangles();
  const std::string whole = file.glb();
  const Folder folder;
  const SceneData scene = loadGltf(folder.write("a.glb", whole.substr(0, whole.size() - 20)));
  CHECK(hasWarning(scene, "is truncated: its header says"));
  REQUIRE(scene.meshes.size() == 1);
  CHECK(x(scene) == 0);
}

TEST_CASE("lenient: attributes that cannot be read are as if absent") {
  GltfFile file = quadFile();
  Json& attributes = file.primitive()["attributes"];
  std::string warning;
  SUBCASE("too few") {
    attributes["NORMAL"] = file.accessor<float>({0, 0, 1}, "VEC3");
    warning = "/meshes/0/primitives/0/attributes/NORMAL: accessor 4 has 1 element, but POSITION has 4";
  }
  SUBCASE("out of bounds") {
    file.root["accessors"][1]["byteOffset"] = 4;
    warning = "/accessors/1: needs 4 elements";
  }
  const SceneData scene = loadWarned(file, warning);
  REQUIRE(scene.meshes.size() == 1);
  CHECK(scene.meshes[0].normals.empty());
  CHECK(scene.meshes[0].triangles.size() == 2);
}

TEST_CASE("lenient: triangles of vertices that do not exist are dropped, others stay") {
  GltfFile file = quadFile();
  file.primitive()["indices"] = file.accessor<uint16_t>({0, 1, 2, 0, 2, 4}, "SCALAR");
  const SceneData scene = loadWarned(file, "holds the index 4, but there are 4 vertices");
  CHECK(scene.meshes.at(0).triangles.size() == 1);
}

TEST_CASE("lenient: skins") {
  GltfFile file = triangleFile();
  Json& attributes = file.primitive()["attributes"];
  attributes["WEIGHTS_0"] = file.accessor<float>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  file.root["nodes"] = {{{"mesh", 0}, {"skin", 0}}, {{"translation", {3, 0, 0}}}};
  file.root["scenes"][0]["nodes"] = {0, 1};
  file.root["skins"] = {{{"joints", {1}}}};
  const std::vector<uint8_t> bytes(12, 0);
  attributes["JOINTS_0"] = file.accessor(bytes, "VEC4");
  SUBCASE("32-bit joints are read") {
    attributes["JOINTS_0"] = file.accessor(std::vector<uint32_t>(12, 0), "VEC4");
    CHECK(x(loadWarned(file, "/attributes/JOINTS_0: accessor 3 has the wrong type")) == 3);
  }
  SUBCASE("missing bind matrices are the identity") {
    file.root["skins"][0]["joints"] = {1, 1};
    file.root["skins"][0]["inverseBindMatrices"] =
        file.accessor<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1}, "MAT4");
    CHECK(x(loadWarned(file, "/skins/0/inverseBindMatrices: has 1 matrix for 2 joints")) == 4);
  }
  SUBCASE("no joints") {
    file.root["skins"][0]["joints"] = Json::array();
    CHECK(x(loadWarned(file, "/skins/0/joints: is empty")) == 0);
  }
  SUBCASE("a joint that does not exist moves nothing, others keep their numbers") {
    file.root["skins"][0]["joints"] = {9, 1};
    attributes["JOINTS_0"] = file.accessor<uint8_t>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
    CHECK(x(loadWarned(file, "/skins/0/joints/0: is 9, but nodes end at 1")) == 3);
  }
}

}  // namespace braid::test_gltf_lenient_meshes
