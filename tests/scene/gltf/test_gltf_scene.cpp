// SPDX-License-Identifier: Apache-2.0
// Scenes from glTF: transforms, instances, skins, animations, cameras, lights, visibility and defaults.
#include "renderer/scene/camera.h"
#include "tests/support/gltf_fixture.h"

#include <cmath>

namespace braid::test_gltf_scene {

using namespace test;

namespace {

SceneData loadAt(const GltfFile& file, float time) {
  LoadOptions options;
  options.frameTime = time;
  return file.load(options);
}

bool isNear(const Vec3& a, const Vec3& b) { return glm::length(a - b) < 1e-5f; }

Vec3 origin(const SceneData& scene, size_t instance = 0) { return Vec3(scene.instances.at(instance).toWorld[3]); }

// An animation with one channel on node 0.
void animate(GltfFile& file, const std::string& path, const std::string& interpolation, const std::vector<float>& times,
             const std::vector<float>& values, const std::string& type) {
  const int input = file.accessor(times, "SCALAR"), output = file.accessor(values, type);
  file.append("animations", {{"samplers", {{{"input", input}, {"output", output}, {"interpolation", interpolation}}}},
                             {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", path}}}}}}});
}

}  // namespace

TEST_CASE("gltf: transforms multiply down the tree") {
  GltfFile file = triangleFile();
  file.root["nodes"] = {{{"translation", {1, 0, 0}}, {"scale", {2, 2, 2}}, {"children", {1}}},
                        {{"rotation", {0, 0, std::sqrt(0.5), std::sqrt(0.5)}}, {"children", {2}}},
                        {{"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1}}, {"mesh", 0}}};
  const SceneData scene = file.load();
  CHECK(isNear(origin(scene), Vec3(1, 6, 0)));
  CHECK(isNear(Vec3(scene.instances[0].toWorld * Vec4(1, 0, 0, 0)), Vec3(0, 2, 0)));
}

TEST_CASE("gltf: transforms are multiplied as doubles") {
  GltfFile file = triangleFile();
  file.root["nodes"] = {
      {{"translation", {6371000.123, 0, 0}}, {"children", {1}}},
      {{"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -6371000, 0, 0, 0.99999994}}, {"children", {2}}},
      {{"mesh", 0}}};
  CHECK(std::abs(origin(file.load()).x - 0.123f) < 1e-6f);
}

TEST_CASE("gltf: a mesh used twice is kept once") {
  GltfFile file = triangleFile();
  file.root["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}, {"scale", {-1, 1, 1}}}};
  file.root["scenes"][0]["nodes"] = {0, 1};
  const SceneData scene = file.load();
  CHECK(scene.meshes.size() == 1);
  REQUIRE(scene.instances.size() == 2);
  CHECK(glm::determinant(scene.instances[1].toWorld) < 0);
}

TEST_CASE("gltf: a scale of 0 along one axis flattens a mesh, along two leaves it out") {
  GltfFile file = triangleFile();
  file.node()["scale"] = {1, 1, 0};
  const SceneData flat = file.load();
  CHECK(flat.instances.size() == 1);
  CHECK(!hasWarning(flat, "left out"));
  file.node()["scale"] = {1, 0, 0};
  const SceneData gone = file.load();
  CHECK(gone.instances.empty());
  CHECK(hasWarning(gone, "a line or a point"));
}

TEST_CASE("gltf: cameras, lights and meshes beyond what rays reach are left out") {
  GltfFile file = triangleFile();
  file.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 0.1}}}}};
  file.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
  const nlohmann::json far = {0, 1e30, 0};
  file.root["nodes"].push_back({{"camera", 0}, {"translation", far}});
  file.root["nodes"].push_back({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}, {"translation", far}});
  file.root["nodes"].push_back({{"mesh", 0}, {"translation", far}});
  file.root["scenes"][0]["nodes"] = {0, 1, 2, 3};
  const SceneData scene = file.load();
  CHECK(scene.defaultCamera);
  CHECK(scene.lights.empty());
  CHECK(scene.instances.size() == 1);
  CHECK(hasWarning(scene, "the camera is left out"));
  CHECK(hasWarning(scene, "the light is left out"));
  CHECK(hasWarning(scene, "endless is left out"));
}

TEST_CASE("gltf: scenes are chosen, and may be missing") {
  GltfFile file = triangleFile();
  file.root["nodes"].push_back({{"mesh", 0}, {"translation", {5, 0, 0}}});
  file.root["scenes"] = {{{"name", "a"}, {"nodes", {0}}}, {{"name", "b"}, {"nodes", {1}}}};
  file.root["scene"] = 1;
  CHECK(origin(file.load()).x == 5);
  CHECK(file.load().sceneNames == std::vector<std::string>{"a", "b"});
  LoadOptions options;
  options.scene = 0;
  CHECK(origin(file.load(options)).x == 0);
  options.scene = 2;
  CHECK(errorOf(file, options).find("the file has 2 scenes") != std::string::npos);
  file.root.erase("scene");
  file.root.erase("scenes");
  const SceneData all = file.load();
  CHECK(all.instances.size() == 2);
  CHECK(hasWarning(all, "no scene"));
}

TEST_CASE("gltf: a deep chain of nodes") {
  GltfFile file = triangleFile();
  constexpr int kDepth = 20000;
  file.root["nodes"] = Json::array();
  for (int i = 0; i < kDepth; ++i) file.root["nodes"].push_back({{"children", {i + 1}}});
  file.root["nodes"].push_back({{"mesh", 0}});
  CHECK(file.load().instances.size() == 1);
}

TEST_CASE("gltf: EXT_mesh_gpu_instancing") {
  GltfFile file = triangleFile();
  file.root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  const int t = file.accessor<float>({1, 0, 0, 2, 0, 0}, "VEC3"), s = file.accessor<float>({1, 1, 1, 3, 3, 3}, "VEC3");
  const int r = file.accessor<int16_t>({0, 0, 0, 32767, 0, 0, 32767, 0}, "VEC4", true);
  file.node()["translation"] = {0, 1, 0};
  file.node()["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", t}, {"ROTATION", r}, {"SCALE", s}};
  const SceneData scene = file.load();
  REQUIRE(scene.instances.size() == 2);
  CHECK(scene.meshes.size() == 1);
  CHECK(isNear(origin(scene, 1), Vec3(2, 1, 0)));
  CHECK(isNear(Vec3(scene.instances[1].toWorld * Vec4(1, 0, 0, 0)), Vec3(-3, 0, 0)));
  file.root["accessors"][static_cast<size_t>(s)]["count"] = 1;
  CHECK_ERROR(file, "another count");
}

TEST_CASE("gltf: KHR_node_visibility hides the meshes and lights of a subtree") {
  GltfFile file = triangleFile();
  file.root["extensionsUsed"] = {"KHR_node_visibility", "KHR_lights_punctual"};
  file.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
  file.root["nodes"] = {{{"children", {1}}, {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}},
                        {{"mesh", 0}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}}};
  const SceneData scene = file.load();
  CHECK(scene.instances.empty());
  CHECK(scene.lights.empty());
}

TEST_CASE("gltf: skinned meshes follow their joints, not their node") {
  GltfFile file = triangleFile();
  file.primitive()["attributes"]["JOINTS_0"] = file.accessor<uint8_t>({0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, "VEC4");
  file.primitive()["attributes"]["WEIGHTS_0"] =
      file.accessor<float>({1, 0, 0, 0, 0.5f, 0.5f, 0, 0, 2, 0, 0, 0}, "VEC4");
  const int inverse = file.accessor<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0,  0, 0, 1,  //
                                            1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1},
                                           "MAT4");
  file.root["nodes"] = {
      {{"mesh", 0}, {"skin", 0}, {"translation", {100, 0, 0}}}, {{"name", "still"}}, {{"translation", {1, 4, 0}}}};
  file.root["scenes"][0]["nodes"] = {0, 1};
  file.root["skins"] = {{{"joints", {1, 2}}, {"inverseBindMatrices", inverse}}};
  SUBCASE("rest pose") {
    const SceneData scene = file.load();
    CHECK(scene.instances[0].toWorld == Mat4(1));
    CHECK(isNear(scene.meshes[0].positions[0], Vec3(0, 0, 0)));
    CHECK(isNear(scene.meshes[0].positions[1], Vec3(1, 2, 0)));
    CHECK(isNear(scene.meshes[0].positions[2], Vec3(0, 5, 0)));
  }
  SUBCASE("a second set of joints") {
    file.primitive()["attributes"]["JOINTS_1"] = file.accessor<uint16_t>({1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC4");
    file.primitive()["attributes"]["WEIGHTS_1"] =
        file.accessor<uint8_t>({255, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC4", true);
    CHECK(isNear(file.load().meshes[0].positions[0], Vec3(0, 2, 0)));
  }
  SUBCASE("vertices without weights") {
    file.primitive()["attributes"]["WEIGHTS_0"] = file.accessor<float>(std::vector<float>(12, 0.0f), "VEC4");
    CHECK(hasWarning(file.load(), "has no weights"));
  }
  SUBCASE("joints out of range") {
    file.primitive()["attributes"]["JOINTS_0"] = file.accessor<uint8_t>({0, 0, 0, 0, 0, 7, 0, 0, 1, 0, 0, 0}, "VEC4");
    CHECK_ERROR(file, "/meshes/0/primitives/0/attributes/JOINTS_0: names joint 7, but skin 0 has 2 joints");
  }
  SUBCASE("too few matrices") {
    file.root["skins"][0]["joints"] = {1, 2, 1};
    CHECK_ERROR(file, "/skins/0/inverseBindMatrices: has 2 matrices for 3 joints");
  }
}

TEST_CASE("gltf: animations are evaluated at the frame time and clamped to their keys") {
  GltfFile file = triangleFile();
  SUBCASE("linear") {
    animate(file, "translation", "LINEAR", {1, 3}, {0, 0, 0, 4, 0, 0}, "VEC3");
    CHECK(loadAt(file, 0).instances[0].toWorld[3].x == 0);
    CHECK(loadAt(file, 2).instances[0].toWorld[3].x == 2);
    CHECK(loadAt(file, 9).instances[0].toWorld[3].x == 4);
  }
  SUBCASE("step") {
    animate(file, "scale", "STEP", {0, 1}, {2, 2, 2, 3, 3, 3}, "VEC3");
    CHECK(loadAt(file, 0.99f).instances[0].toWorld[0].x == 2);
    CHECK(loadAt(file, 1).instances[0].toWorld[0].x == 3);
  }
  SUBCASE("spherical") {
    const float h = std::sqrt(0.5f);
    animate(file, "rotation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0, -h, -h}, "VEC4");
    const Mat4 m = loadAt(file, 0.5f).instances[0].toWorld;
    CHECK(m[0].x == doctest::Approx(std::cos(kPi / 4)));
    CHECK(m[0].y == doctest::Approx(std::sin(kPi / 4)));
  }
  SUBCASE("cubic") {
    animate(file, "translation", "CUBICSPLINE", {0, 2}, {0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC3");
    // Only the out-tangent of the first key is not zero: d (t³ - 2t² + t) with d = 2, t = 1/2.
    CHECK(loadAt(file, 1).instances[0].toWorld[3].x == doctest::Approx(0.25));
  }
  SUBCASE("weights") {
    file.primitive()["targets"] = {{{"POSITION", 0}}};
    animate(file, "weights", "LINEAR", {0, 1}, {0, 1}, "SCALAR");
    CHECK(loadAt(file, 0.5f).meshes[0].positions[1].x == 1.5f);
  }
  SUBCASE("key times that do not increase") {
    animate(file, "translation", "LINEAR", {0, std::nanf(""), 1}, {1, 0, 0, 2, 0, 0, 3, 0, 0}, "VEC3");
    const SceneData scene = loadAt(file, 0.5f);
    CHECK(origin(scene).x == 0);
    CHECK(hasWarning(scene, "do not increase"));
  }
}

TEST_CASE("gltf: one of two animations is chosen by name or index; without a time the rest pose is shown") {
  GltfFile file = triangleFile();
  animate(file, "translation", "LINEAR", {0}, {7, 0, 0}, "VEC3");
  animate(file, "translation", "LINEAR", {0}, {8, 0, 0}, "VEC3");
  CHECK(origin(file.load()).x == 0);
  LoadOptions options;
  options.frameTime = 0.0f;
  CHECK(origin(file.load(options)).x == 7);  // the first
  options.animation = "1";
  CHECK(origin(file.load(options)).x == 8);
  file.root["animations"][0]["name"] = "walk";
  file.root["animations"][1]["name"] = "0";  // names come first
  options.animation = "walk";
  CHECK(origin(file.load(options)).x == 7);
  options.animation = "0";
  CHECK(origin(file.load(options)).x == 8);
  options.animation = "run";
  const std::string error = errorOf([&] { file.load(options); }, ExitCode::Usage);
  CHECK(error.find("the file has 0 'walk', 1 '0'") != std::string::npos);
}

TEST_CASE("gltf: cameras ignore scale and keep the order of the scene") {
  GltfFile file = triangleFile();
  file.root["cameras"] = {
      {{"type", "orthographic"},
       {"name", "o"},
       {"orthographic", {{"xmag", 2}, {"ymag", 3}, {"znear", 0}, {"zfar", 9}}}},
      {{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"aspectRatio", 1.5}, {"znear", 0.1}}}}};
  file.root["nodes"] = {{{"camera", 1}, {"name", "front"}, {"scale", {4, 5, 6}}, {"translation", {1, 2, 3}}},
                        {{"camera", 0}},
                        {{"mesh", 0}}};
  file.root["scenes"][0]["nodes"] = {0, 1, 2};
  const SceneData scene = file.load();
  REQUIRE(scene.cameras.size() == 2);
  CHECK(scene.cameras[0].name == "front");
  CHECK(scene.cameras[0].yfov == 0.5f);
  CHECK(scene.cameras[0].aspect.value() == 1.5f);
  CHECK(scene.cameras[0].toWorld == glm::translate(Mat4(1), Vec3(1, 2, 3)));
  CHECK(scene.cameras[1].name == "o");
  CHECK(scene.cameras[1].orthographic);
  CHECK(scene.cameras[1].xmag == 2);
  CHECK_FALSE(scene.defaultCamera);
}

TEST_CASE("gltf: a default camera sees every vertex") {
  GltfFile file = triangleFile();
  file.node()["translation"] = {30, 0, 0};
  const SceneData scene = file.load();
  CHECK(scene.defaultCamera);
  REQUIRE(scene.cameras.size() == 1);
  const CameraData& camera = scene.cameras[0];
  const Camera view(camera, 400, 300);
  for (const Vec3& p : {Vec3(30, 0, 0), Vec3(31, 0, 0), Vec3(30, 1, 0)}) {
    const auto raster = view.project(p);
    REQUIRE(raster);
    CHECK((raster->x > 0 && raster->x < 400 && raster->y > 0 && raster->y < 300));
  }
  // A panel in the plane z = 0 is seen from the front.
  CHECK(camera.toWorld[2].z > 0.95f);
}

TEST_CASE("gltf: punctual lights are placed by their nodes and keep their numbers") {
  GltfFile file = triangleFile();
  file.root["extensionsUsed"] = {"KHR_lights_punctual"};
  file.root["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "spot"},
       {"color", {1, 0.5, 0}},
       {"intensity", 10},
       {"range", 4},
       {"spot", {{"innerConeAngle", 0.1}, {"outerConeAngle", 0.2}}}},
      {{"type", "directional"}, {"name", "sun"}},
      {{"type", "spot"}, {"spot", {{"innerConeAngle", 0.9}, {"outerConeAngle", 0.2}}}}};
  const double h = std::sqrt(0.5);
  const auto light = [](int index) { return Json{{"KHR_lights_punctual", {{"light", index}}}}; };
  file.root["nodes"] = {
      {{"extensions", light(0)}, {"translation", {1, 2, 3}}, {"scale", {9, 9, 9}}, {"rotation", {-h, 0, 0, h}}},
      {{"extensions", light(1)}},
      {{"extensions", light(2)}}};
  file.root["scenes"][0]["nodes"] = {0, 1, 2};
  const SceneData scene = file.load();
  REQUIRE(scene.lights.size() == 3);
  CHECK(scene.lights[0].kind == PunctualKind::Spot);
  CHECK(scene.lights[0].intensity == Spectrum(10, 5, 0));
  CHECK(scene.lights[0].range == 4);
  CHECK(scene.lights[0].position == Vec3(1, 2, 3));
  CHECK(isNear(scene.lights[0].direction, Vec3(0, -1, 0)));
  CHECK(scene.lights[0].outerConeAngle == 0.2f);
  CHECK(scene.lights[1].name == "sun");
  CHECK(std::isinf(scene.lights[1].range));
  CHECK(scene.lights[2].innerConeAngle < scene.lights[2].outerConeAngle);
  CHECK(hasWarning(scene, "inner cone"));
  CHECK_FALSE(scene.defaultLight);
}

TEST_CASE("gltf: a dark file gets a grey dome, unless told otherwise") {
  GltfFile file = triangleFile();
  const SceneData scene = file.load();
  CHECK(scene.defaultLight);
  REQUIRE(scene.environment);
  CHECK(scene.environment->radiance == Spectrum(0.5f));
  LoadOptions options;
  options.defaultLight = DefaultLight::None;
  CHECK_FALSE(file.load(options).environment);
  giveMaterial(file, {{"emissiveFactor", {1, 0, 0}}});
  CHECK_FALSE(file.load().defaultLight);
}

TEST_CASE("gltf: warnings reach the sink") {
  const Folder folder;
  std::vector<std::string> lines;
  const SceneData scene =
      loadGltf(folder.write("a.glb", triangleFile().glb()), {}, [&](LogLevel level, const std::string& line) {
        CHECK(level == LogLevel::Warning);
        lines.push_back(line);
      });
  CHECK(lines.size() == scene.warnings.size());
  CHECK(lines.size() == 2);
}

}  // namespace braid::test_gltf_scene
