// SPDX-License-Identifier: Apache-2.0
// Nodes, cameras, lights and animations of a flawed file: what cannot be read is left out or as by default, with a
// warning.
#include "tests/scene/gltf/gltf_lenient.h"
#include "tests/support/gltf_fixture.h"

#include <cmath>
#include <limits>

namespace braid::test_gltf_lenient_nodes {

using namespace test;
using namespace test::gltf_lenient;

TEST_CASE("lenient: the camera that looks is the one whose flaws matter") {
  GltfFile file = triangleFile();
  file.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 1}}}},
                          {{"type", "perspective"}, {"perspective", {{"yfov", -1}, {"znear", 0}}}}};
  file.append("nodes", {{"camera", 0}});
  file.append("nodes", {{"camera", 1}, {"name", "eye"}});
  file.root["scenes"][0]["nodes"] = {0, 1, 2};
  CHECK(hasNote(file.load(), "/cameras/1/perspective/yfov: is not positive"));
  LoadOptions options;
  options.camera = "eye";
  const SceneData scene = file.load(options);
  CHECK(hasWarning(scene, "/cameras/1/perspective/yfov: is not positive"));
  REQUIRE(scene.cameras.size() == 2);
  CHECK(scene.cameras[1].yfov > 0);
}

TEST_CASE("lenient: lights") {
  GltfFile file = triangleFile();
  file.node()["extensions"]["KHR_lights_punctual"]["light"] = 0;
  const auto light = [&](const Json& json, const std::string& warning) {
    file.root["extensions"]["KHR_lights_punctual"]["lights"] = {json};
    return loadWarned(file, "/extensions/KHR_lights_punctual/lights/0" + warning).lights.at(0);
  };
  CHECK(std::isinf(light({{"type", "point"}, {"range", 1.797e308}}, "/range: is 1.797e+308, too large").range));
  CHECK(std::isinf(light({{"type", "point"}, {"range", 0}}, "/range: is not positive").range));
  CHECK(light({{"type", "lamp"}}, "/type: is 'lamp'").kind == PunctualKind::Point);
  CHECK(light({{"type", "spot"}}, "/spot: is missing").kind == PunctualKind::Spot);
  CHECK(light({{"type", "point"}, {"intensity", 3e38}, {"color", {9, 1, 1}}}, "/intensity: times color").intensity.x ==
        std::numeric_limits<float>::max());
  file.root["extensions"]["KHR_lights_punctual"]["lights"] = Json::array();
  CHECK(loadWarned(file, "/nodes/0/extensions/KHR_lights_punctual/light: is 0, but the file has no lights")
            .lights.empty());
}

TEST_CASE("lenient: matrices") {
  GltfFile file = triangleFile();
  Json matrix = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1};
  SUBCASE("rounding in the last row is no flaw at all") {
    matrix[15] = 0.99999994;
    matrix[3] = 1e-9;
    file.node()["matrix"] = matrix;
    const SceneData scene = file.load();
    CHECK(scene.instances.at(0).toWorld[3] == Vec4(7, 0, 0, 1));
    CHECK(scene.instances.at(0).toWorld[0] == Vec4(1, 0, 0, 0));
    CHECK_FALSE(hasWarning(scene, "affine"));
    CHECK(errorOf(file).empty());
  }
  SUBCASE("a projection loses its last row") {
    matrix[3] = 1;
    file.node()["matrix"] = matrix;
    CHECK(loadWarned(file, "/nodes/0/matrix: is not affine").instances.at(0).toWorld[3] == Vec4(7, 0, 0, 1));
  }
  SUBCASE("one that is none is absent") {
    file.node()["matrix"] = {1, 2, 3};
    CHECK(loadWarned(file, "/nodes/0/matrix: is 3 entries").instances.at(0).toWorld == Mat4(1));
  }
}

TEST_CASE("lenient: nodes that form no tree") {
  GltfFile file = triangleFile();
  SUBCASE("a cycle is cut") {
    file.root["nodes"] = {{{"children", {1}}}, {{"children", {0, 2}}}, {{"mesh", 0}}};
    CHECK(loadWarned(file, "leads back to node").instances.size() == 1);
  }
  SUBCASE("its own child") {
    file.root["nodes"] = {{{"children", {0}}, {"mesh", 0}}};
    CHECK(loadWarned(file, "/nodes/0/children: leads back to node 0").instances.size() == 1);
  }
  SUBCASE("of two parents the first has it") {
    file.root["nodes"] = {{{"children", {1, 2}}, {"translation", {1, 0, 0}}},
                          {{"children", {2}}, {"translation", {5, 0, 0}}},
                          {{"mesh", 0}}};
    const SceneData scene = loadWarned(file, "/nodes/1/children: names node 2, already a child of node 0");
    REQUIRE(scene.instances.size() == 1);
    CHECK(scene.instances[0].toWorld[3].x == 1);
  }
  SUBCASE("children and meshes that do not exist") {
    file.root["nodes"] = {{{"children", {1, 9, 2}}}, {{"mesh", 0}}, {{"mesh", 9}}};
    const SceneData scene = loadWarned(file, "/nodes/0/children/1: is 9, but nodes end at 2");
    CHECK(hasWarning(scene, "/nodes/2/mesh: is 9"));
    CHECK(scene.instances.size() == 1);
  }
  SUBCASE("the scene does not exist") {
    file.root["scene"] = 4;
    CHECK(loadWarned(file, "/scene: is 4, but scenes end at 0").instances.size() == 1);
  }
}

TEST_CASE("lenient: animations") {
  GltfFile file = triangleFile();
  LoadOptions options;
  options.frameTime = 1.5f;
  const auto addChannel = [&](const std::vector<float>& times, const std::vector<float>& values, const char* path) {
    const int input = file.accessor(times, "SCALAR"), output = file.accessor(values, "VEC3");
    Json& clip = file.root["animations"][0];
    clip["samplers"].push_back({{"input", input}, {"output", output}});
    clip["channels"].push_back({{"sampler", clip["samplers"].size() - 1}, {"target", {{"node", 0}, {"path", path}}}});
  };
  SUBCASE("two keys at one time are a jump") {
    addChannel({0, 1, 1, 2}, {0, 0, 0, 1, 0, 0, 5, 0, 0, 7, 0, 0}, "translation");
    const auto at = [&](float time) {
      options.frameTime = time;
      return file.load(options).instances.at(0).toWorld[3].x;
    };
    CHECK(at(0.5f) == 0.5f);
    CHECK(at(1) == 5);
    CHECK(at(1.5f) == 6);
    CHECK(hasWarning(file.load(options), "two keys at one time"));
  }
  SUBCASE("a channel that cannot be read leaves the others") {
    addChannel({0, 1, 2}, {0, 0, 0}, "scale");
    addChannel({0, 2}, {0, 0, 0, 4, 0, 0}, "translation");
    addChannel({0, 2}, {0, 0, 0, 4, 0, 0}, "colour");
    Json& clip = file.root["animations"][0];
    clip["channels"].push_back({{"sampler", 9}, {"target", {{"node", 0}, {"path", "scale"}}}});
    clip["channels"].push_back({{"target", 3}});
    clip["samplers"].push_back({{"input", 77}});
    const SceneData scene = loadWarned(file, "/animations/0/channels/0/sampler: has 1 value", options);
    CHECK(scene.instances.at(0).toWorld[3].x == 3);
    CHECK(hasWarning(scene, "/animations/0/channels/2/target/path: is 'colour'"));
    CHECK(hasWarning(scene, "/animations/0/channels/3/sampler: is 9"));
    CHECK(hasWarning(scene, "/animations/0/samplers/3/input: is 77"));
  }
}

}  // namespace braid::test_gltf_lenient_nodes
