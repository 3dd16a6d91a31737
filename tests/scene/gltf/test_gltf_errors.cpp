// SPDX-License-Identifier: Apache-2.0
// Broken glTF files are refused with every problem, its place and the mend; nothing crashes.
#include "tests/support/contains.h"
#include "tests/support/gltf_fixture.h"

#include <algorithm>

namespace braid::test_gltf_errors {

using namespace test;

TEST_CASE("gltf errors: every problem is listed, each with its place") {
  GltfFile file = triangleFile();
  file.root["accessors"][0]["componentType"] = 1234;
  file.root["nodes"][0]["mesh"] = 7;
  file.root["materials"] = {{{"alphaMode", "GLASS"}, {"doubleSided", "yes"}}};
  file.root["scene"] = -1;
  const Folder folder;
  const std::string path = folder.write("a.glb", file.glb());
  LoadOptions options;
  options.strict = true;
  try {
    loadGltf(path, options);
    FAIL("loaded");
  } catch (const SceneError& error) {
    CHECK(error.code() == ExitCode::BadInput);
    std::vector<std::string> places;
    for (const Problem& p : error.problems()) places.push_back(p.place);
    std::sort(places.begin(), places.end());
    CHECK(places == std::vector<std::string>{"/accessors/0/componentType", "/materials/0/alphaMode",
                                             "/materials/0/doubleSided", "/nodes/0/mesh", "/scene"});
    const std::string text = error.what();
    CHECK(std::count(text.begin(), text.end(), '\n') == 4);
    CHECK(contains(text, path + ": /nodes/0/mesh: is 7, but meshes end at 0"));
  }
}

TEST_CASE("gltf errors: the list of problems is bounded") {
  GltfFile file = triangleFile();
  for (int i = 0; i < 5000; ++i) file.root["nodes"].push_back({{"mesh", 7 + i}});
  const std::string text = errorOf(file);
  CHECK(std::count(text.begin(), text.end(), '\n') <= 201);
  CHECK(contains(text, "and 4800 more problems"));
}

TEST_CASE("gltf errors: required extensions that are unknown have an exit code of their own") {
  GltfFile file = triangleFile();
  file.root["extensionsUsed"] = {"ACME_gizmo", "ACME_other"};
  CHECK(hasWarning(file.load(), "'ACME_gizmo', 'ACME_other'"));
  file.root["extensionsRequired"] = {"ACME_gizmo", "ACME_third"};
  // Found before missing buffers and the like.
  file.root["buffers"] = {{{"uri", "missing.bin"}, {"byteLength", 36}}};
  const std::string text = errorOf([&] { file.load(); }, ExitCode::UnsupportedExtension);
  CHECK(contains(text, "/extensionsRequired/0: extension 'ACME_gizmo' is not supported"));
  CHECK(contains(text, "/extensionsRequired/1: extension 'ACME_third'"));
}

TEST_CASE("gltf errors: the same data asked for again and again") {
  GltfFile file = quadFile();
  const std::vector<float> points(300000, 0.0f);
  const int position = file.accessor(points, "VEC3");
  file.root["meshes"] = {{{"primitives", Json::array()}}};
  for (int i = 0; i < 2000; ++i) {
    file.append("materials", Json::object());
    file.root["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", position}}}, {"material", i}});
  }
  CHECK_ERROR(file, "repeats its data");
}

TEST_CASE("gltf errors: primitives") {
  GltfFile file = quadFile();
  Json& attributes = file.primitive()["attributes"];
  SUBCASE("index out of range") {
    file.primitive()["indices"] = file.accessor<uint16_t>({0, 1, 4}, "SCALAR");
    CHECK_ERROR(file, "/meshes/0/primitives/0/indices: accessor 4 holds the index 4, but there are 4 vertices");
  }
  SUBCASE("restart index") {
    file.primitive()["indices"] = file.accessor<uint16_t>({0, 1, 65535}, "SCALAR");
    CHECK_ERROR(file, "holds the index 65535");
  }
  SUBCASE("float indices") {
    file.primitive()["indices"] = file.accessor<float>({0, 1, 2}, "SCALAR");
    CHECK_ERROR(file, "/meshes/0/primitives/0/indices: accessor 4 has the wrong type");
  }
  SUBCASE("counts differ") {
    attributes["NORMAL"] = file.accessor<float>({0, 0, 1}, "VEC3");
    CHECK_ERROR(file, "/meshes/0/primitives/0/attributes/NORMAL: accessor 4 has 1 element, but POSITION has 4");
  }
  SUBCASE("wrong type") {
    attributes["POSITION"] = file.accessor<float>({0, 0, 1, 1, 0, 1, 1, 1}, "VEC2");
    CHECK_ERROR(file, "/meshes/0/primitives/0/attributes/POSITION");
  }
  SUBCASE("mode") {
    file.primitive()["mode"] = 7;
    CHECK_ERROR(file, "/meshes/0/primitives/0/mode: is 7");
  }
  SUBCASE("material") {
    file.primitive()["material"] = 3;
    CHECK_ERROR(file, "/meshes/0/primitives/0/material: is 3, but the file has no materials");
  }
  SUBCASE("no attributes") {
    file.primitive().erase("attributes");
    CHECK_ERROR(file, "/meshes/0/primitives/0/attributes: is missing");
  }
  SUBCASE("no positions are only skipped") {
    attributes.erase("POSITION");
    CHECK(hasWarning(file.load(), "without POSITION"));
  }
  SUBCASE("morph target") {
    file.primitive()["targets"] = {{{"POSITION", file.accessor<float>({1, 1, 1}, "VEC3")}}};
    CHECK_ERROR(file, "/meshes/0/primitives/0/targets/0/POSITION");
  }
}

TEST_CASE("gltf errors: nodes must form a tree") {
  GltfFile file = triangleFile();
  SUBCASE("cycle") {
    file.root["nodes"] = {{{"children", {1}}}, {{"children", {0}}}};
    CHECK_ERROR(file, "/nodes/0/children: leads back to node 0");
  }
  SUBCASE("own child") {
    file.root["nodes"] = {{{"children", {0}}}};
    CHECK_ERROR(file, "leads back to node 0");
  }
  SUBCASE("two parents") {
    file.root["nodes"] = {{{"children", {1, 2}}}, {{"children", {2}}}, {{"mesh", 0}}};
    CHECK_ERROR(file, "/nodes/1/children: names node 2, already a child of node 0");
  }
  SUBCASE("matrix") {
    file.node()["matrix"] = {1, 2, 3};
    CHECK_ERROR(file, "/nodes/0/matrix: is 3 entries; it must be an array of 16 numbers");
  }
  SUBCASE("projective matrix") {
    file.node()["matrix"] = {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    CHECK_ERROR(file, "/nodes/0/matrix: is not affine");
  }
  SUBCASE("wrong types") {
    file.node()["translation"] = {1, "two", 3};
    file.node()["children"] = 1;
    const std::string text = errorOf(file);
    CHECK(contains(text, "/nodes/0/translation/1: is the text 'two'; it must be a number"));
    CHECK(contains(text, "/nodes/0/children: is 1; it must be an array"));
  }
  SUBCASE("number beyond a float") {
    file.node()["scale"] = {1e39, 1, 1};
    CHECK_ERROR(file, "too large for a 32-bit float");
  }
}

TEST_CASE("gltf errors: cameras, lights and animations") {
  GltfFile file = triangleFile();
  SUBCASE("field of view") {
    file.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", -1}, {"znear", 0.1}}}}};
    CHECK_ERROR(file, "/cameras/0/perspective/yfov: is not positive");
  }
  SUBCASE("type") {
    file.root["cameras"] = {{{"type", "fisheye"}}};
    CHECK_ERROR(file, "/cameras/0/type: is 'fisheye'");
  }
  SUBCASE("extent") {
    file.root["cameras"] = {{{"type", "orthographic"}, {"orthographic", {{"xmag", 0}, {"ymag", 1}}}}};
    CHECK_ERROR(file, "/cameras/0/orthographic/xmag: is 0");
  }
  SUBCASE("range") {
    file.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"range", 0}}};
    CHECK_ERROR(file, "/extensions/KHR_lights_punctual/lights/0/range: is not positive");
  }
  SUBCASE("light index") {
    file.node()["extensions"]["KHR_lights_punctual"]["light"] = 0;
    CHECK_ERROR(file, "/nodes/0/extensions/KHR_lights_punctual/light: is 0, but the file has no lights");
  }
  SUBCASE("sampler output") {
    const int input = file.accessor<float>({0, 1, 2}, "SCALAR"), output = file.accessor<float>({0, 0, 0}, "VEC3");
    file.root["animations"] = {{{"samplers", {{{"input", input}, {"output", output}}}},
                                {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}}};
    CHECK_ERROR(file, "/animations/0/channels/0/sampler: has 1 value for 3 key times; it needs 3");
    file.root["animations"][0]["channels"][0]["target"]["path"] = "colour";
    CHECK_ERROR(file, "is 'colour'; it must be one of");
    file.root["animations"][0]["channels"][0]["target"]["path"] = "rotation";
    CHECK_ERROR(file, "wrong type");
  }
}

TEST_CASE("gltf errors: images") {
  GltfFile file = quadFile();
  const int texture = addTexture(file);
  giveMaterial(file, {{"normalTexture", {{"index", texture}}}});
  SUBCASE("broken") {
    file.root["bufferViews"].back()["byteLength"] = 50;
    CHECK_ERROR(file, "/images/0: is");
  }
  SUBCASE("unknown format") {
    file.root["images"][0]["bufferView"] = 0;
    CHECK_ERROR(file, "/images/0: is not an image of a known format");
  }
  SUBCASE("neither uri nor view") {
    file.root["images"][0] = {{"name", "x"}};
    CHECK_ERROR(file, "/images/0: has neither uri nor bufferView");
  }
  SUBCASE("texture index") {
    file.root["materials"][0]["normalTexture"]["index"] = 4;
    CHECK_ERROR(file, "/materials/0/normalTexture/index: is 4, but textures end at 0");
  }
  SUBCASE("wrap mode") {
    file.root["samplers"] = {{{"wrapS", 5}}};
    CHECK_ERROR(file, "/samplers/0/wrapS: is 5");
  }
}

TEST_CASE("gltf errors: wrong JSON types everywhere are problems, not crashes") {
  const GltfFile original = quadFile();
  const Json flat = original.root.flatten();
  for (const Json& wrong : {Json(nullptr), Json("text"), Json(-1), Json(1e300), Json::array({Json::object()}),
                            Json::object(), Json(true)}) {
    for (const auto& entry : flat.items()) {
      GltfFile file = original;
      file.root[Json::json_pointer(entry.key())] = wrong;
      CAPTURE(entry.key());
      try {
        file.load();
      } catch (const Error& error) {
        CHECK(error.code() == ExitCode::BadInput);
      }
    }
  }
}

}  // namespace braid::test_gltf_errors
