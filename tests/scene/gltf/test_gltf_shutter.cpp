// SPDX-License-Identifier: Apache-2.0
// Animations while the shutter is open: which things get steps, at which times, and what stands still.
#include "renderer/scene/data/motion.h"
#include "renderer/scene/scene.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/moving_scenes.h"

namespace braid::test_gltf_shutter {

using namespace test;

namespace {

// Adds a channel of animation 0 that plays on a node.
void animateNode(GltfFile& file, int node, const char* path, const std::vector<float>& times,
                 const std::vector<float>& values, const char* interpolation = "LINEAR") {
  if (!file.root.contains("animations"))
    file.append("animations", {{"samplers", Json::array()}, {"channels", Json::array()}});
  const std::string shape = std::string(path) == "weights"    ? "SCALAR"
                            : std::string(path) == "rotation" ? "VEC4"
                                                              : "VEC3";
  Json& animation = file.root["animations"][0];
  animation["channels"].push_back(
      {{"sampler", animation["samplers"].size()}, {"target", {{"node", node}, {"path", path}}}});
  const int input = file.accessor<float>(times, "SCALAR");
  animation["samplers"].push_back(
      {{"input", input}, {"output", file.accessor<float>(values, shape)}, {"interpolation", interpolation}});
}

LoadOptions shutterFrom(float time, double seconds) {
  LoadOptions options = GltfFile::plainLight();
  options.frameTime = time;
  options.shutter = seconds;
  return options;
}

// The point of a mesh placed by instance 0 at a share of the shutter's seconds.
Vec3 placeAt(const SceneData& scene, float share) {
  const float time = shutterTime(scene.motion, share);
  const MeshInstance& i = scene.instances.at(0);
  if (i.steps.empty()) return Vec3(i.toWorld[3]);
  const Moment m = momentAt(time, i.steps.size());
  const Mat4 &a = m.first == 0 ? i.toWorld : i.steps[m.first - 1], &b = i.steps[m.first];
  return Vec3(between(a, b, m.fraction)[3]);
}

// An unlit white quad of the file seen from the front: x from -1 to 3.
double shareCovered(SceneData data, double x, uint64_t spp = 4096) {
  CameraData camera = spotCamera({static_cast<float>(x), 0.5f, 3}, {static_cast<float>(x), 0.5f, 0}, 0.01f);
  data.cameras = {camera};
  data.environment.reset();
  Settings settings = settingsFor(2, 2, spp);
  settings.background = Spectrum(0);
  return meanOf(render(std::move(data), settings)).value;
}

GltfFile unlitQuad() {
  GltfFile file = quadFile();
  giveMaterial(file, {{"extensions", {{"KHR_materials_unlit", Json::object()}}}});
  file.root["extensionsUsed"] = {"KHR_materials_unlit"};
  return file;
}

}  // namespace

TEST_CASE("gltf shutter: a straight way is one piece, and kinks at keys are met exactly") {
  GltfFile file = unlitQuad();
  animateNode(file, 0, "translation", {0, 1, 1.5f}, {0, 0, 0, 1, 0, 0, 1, 2, 0});
  const SceneData straight = file.load(shutterFrom(0.25f, 0.5));
  CHECK(straight.motion.times == std::vector<float>{0, 1});
  REQUIRE(straight.instances[0].steps.size() == 1);
  CHECK(placeAt(straight, 0).x == doctest::Approx(0.25));
  CHECK(placeAt(straight, 1).x == doctest::Approx(0.75));
  const SceneData bent = file.load(shutterFrom(0.5f, 2));
  // Its own bend at 1 s, and the end of the clip at 1.5 s.
  CHECK(bent.motion.times.size() == 4);
  for (const float time : {0.5f, 0.7f, 0.99f, 1.0f, 1.2f, 1.5f, 1.7f, 2.5f}) {
    const Vec3 p = placeAt(bent, (time - 0.5f) / 2), x(std::min(time, 1.0f), std::clamp(4 * (time - 1), 0.0f, 2.0f), 0);
    CAPTURE(time);
    CHECK(glm::length(p - x) < 1e-3f);
  }
  CHECK(bent.warnings == file.load(shutterFrom(0.5f, 0)).warnings);
}

TEST_CASE("gltf shutter: a jump is one; the thing is never in between") {
  GltfFile file = unlitQuad();
  // The quad is at 0 for a quarter of the time, then at 2.
  animateNode(file, 0, "translation", {0, 1.25f}, {0, 0, 0, 2, 0, 0}, "STEP");
  const SceneData data = file.load(shutterFrom(1, 1));
  CHECK(data.motion.times.size() == 4);
  CHECK(placeAt(data, 0.249f).x == 0);
  CHECK(placeAt(data, 0.251f).x == 2);
  CHECK(shareCovered(data, 0.5) == doctest::Approx(0.25).epsilon(0.02));
  CHECK(shareCovered(data, 1.5) == 0);
  CHECK(shareCovered(data, 2.5) == doctest::Approx(0.75).epsilon(0.02));
  // At the shutter's closing it has not jumped yet, at its opening it has.
  CHECK(file.load(shutterFrom(0.25f, 1)).motion.times.empty());
  CHECK(file.load(shutterFrom(1.25f, 1)).motion.times.empty());
}

TEST_CASE("gltf shutter: scaled to nothing, a thing is gone for that time only") {
  for (const bool shared : {false, true}) {
    GltfFile file = unlitQuad();
    animateNode(file, 0, "scale", {0, 0.5f}, {0, 0, 0, 1, 1, 1}, "STEP");
    if (shared) {  // by a second node far away
      file.root["nodes"].push_back({{"mesh", 0}, {"translation", {0, 50, 0}}});
      file.root["scenes"][0]["nodes"] = {0, 1};
    }
    CHECK(shareCovered(file.load(shutterFrom(0, 1)), 0.5) == doctest::Approx(0.5).epsilon(0.02));
    CHECK(shareCovered(file.load(shutterFrom(0.5f, 1)), 0.5) == doctest::Approx(1));
  }
  // Shrinking evenly to a point at the origin, it covers x for the time in which it is larger.
  GltfFile file = unlitQuad();
  animateNode(file, 0, "scale", {0, 1}, {1, 1, 1, 0, 0, 0});
  CHECK(shareCovered(file.load(shutterFrom(0, 1)), 0.75) == doctest::Approx(0.25).epsilon(0.03));
}

TEST_CASE("gltf shutter: a turn is told by so many pieces that it stays round") {
  GltfFile file = unlitQuad();
  const float s = std::sqrt(0.5f);
  animateNode(file, 0, "rotation", {0, 1, 2}, {0, 0, 0, 1, 0, 0, s, s, 0, 0, 1, 0});
  const SceneData data = file.load(shutterFrom(0, 2));
  CHECK(data.motion.times.size() > 8);
  CHECK(data.motion.times.size() <= 17);
  CHECK(data.motion.error < 1.0 / 64);
  for (int i = 0; i < 100; ++i) {
    const float time = shutterTime(data.motion, static_cast<float>(i) / 100);
    const MeshInstance& instance = data.instances[0];
    const Moment m = momentAt(time, instance.steps.size());
    const Mat4 &a = m.first == 0 ? instance.toWorld : instance.steps[m.first - 1], &b = instance.steps[m.first];
    const Vec3 corner(between(a, b, m.fraction) * Vec4(1, 0, 0, 1));
    const float angle = kPi * static_cast<float>(i) / 100;
    CHECK(glm::length(corner - Vec3(std::cos(angle), std::sin(angle), 0)) < 0.01f);
  }
}

TEST_CASE("gltf shutter: morphs and skins move their vertices") {
  GltfFile morph = unlitQuad();
  const int target = morph.accessor<float>({1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0}, "VEC3");
  morph.primitive()["targets"] = {{{"POSITION", target}}};
  animateNode(morph, 0, "weights", {0, 1}, {0, 1});

  GltfFile skin = unlitQuad();
  skin.primitive()["attributes"]["JOINTS_0"] = skin.accessor<uint8_t>(std::vector<uint8_t>(16, 0), "VEC4");
  skin.primitive()["attributes"]["WEIGHTS_0"] =
      skin.accessor<float>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  skin.root["skins"] = {{{"joints", {1}}}};
  skin.node()["skin"] = 0;
  skin.root["nodes"].push_back({{"name", "joint"}});
  skin.root["scenes"][0]["nodes"] = {0, 1};
  animateNode(skin, 1, "translation", {0, 1}, {0, 0, 0, 1, 0, 0});
  for (const GltfFile& file : {morph, skin}) {
    const SceneData data = file.load(shutterFrom(0, 1));
    REQUIRE(onlyMesh(data).steps.size() == 1);
    CHECK(data.instances[0].steps.empty());
    CHECK(glm::length(data.meshes[0].steps[0].positions[0] - Vec3(1, 0, 0)) < 1e-6f);
    // The closed form of [0, 1] moved by 1.
    for (const double x : {0.25, 0.9, 1.0, 1.6}) {
      CAPTURE(x);
      CHECK(shareCovered(data, x) == doctest::Approx(coverage(x, 0, 1, 1)).epsilon(0.03));
    }
    CHECK(file.load(shutterFrom(1, 5)).motion.times.empty());  // beyond the clip
  }
}

TEST_CASE("gltf shutter: cameras and lights have steps, and only the camera that looks counts") {
  GltfFile file = unlitQuad();
  file.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}}}};
  file.root["extensionsUsed"].push_back("KHR_lights_punctual");
  file.root["extensions"] = {{"KHR_lights_punctual", {{"lights", {{{"type", "spot"}}}}}}};
  file.root["nodes"].push_back({{"camera", 0}, {"translation", {0, 0, 3}}});
  file.root["nodes"].push_back({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}, {"translation", {0, 2, 2}}});
  file.root["scenes"][0]["nodes"] = {0, 1, 2};
  GltfFile still = file;
  animateNode(file, 1, "translation", {0, 1}, {0, 0, 3, 1, 0, 3});
  animateNode(file, 2, "translation", {0, 1}, {0, 2, 2, 0, 4, 2});
  const SceneData data = file.load(shutterFrom(0, 1));
  REQUIRE(data.cameras[0].steps.size() == 1);
  CHECK(data.cameras[0].steps[0][3].x == doctest::Approx(1));
  REQUIRE(data.lights[0].steps.size() == 1);
  CHECK(glm::length(data.lights[0].steps[0].position - Vec3(0, 4, 2)) < 1e-6f);
  CHECK(data.instances[0].steps.empty());
  animateNode(still, 1, "translation", {0, 1}, {0, 0, 3, 1, 0, 3});
  LoadOptions elsewhere = shutterFrom(0, 1);
  CHECK(still.load(elsewhere).motion.any());
  elsewhere.camera = "none";
  CHECK_FALSE(still.load(elsewhere).motion.any());
}

TEST_CASE("gltf shutter: where nothing moves, everything is as without one") {
  GltfFile file = unlitQuad();
  animateNode(file, 0, "translation", {0, 1, 2, 3}, {0, 0, 0, 0.1f, 0.7f, 0, 0.1f, 0.7f, 0, 5, 0, 0});
  animateNode(file, 0, "rotation", {0, 1, 2}, {0, 0.1f, 0.2f, 0.9f, 0, 0.3f, 0.1f, 0.8f, 0, 0.3f, 0.1f, 0.8f});
  const SceneData data = file.load(shutterFrom(1.1f, 0.8)), still = file.load(shutterFrom(1.1f, 0));
  CHECK(data.motion.seconds == 0.8);
  CHECK_FALSE(data.motion.any());
  CHECK(data.instances[0].steps.empty());
  CHECK(data.instances[0].toWorld == still.instances[0].toWorld);
  CHECK(data.contentHash == still.contentHash);
  CHECK(data.warnings == still.warnings);
  // A hidden thing that moves is not seen to.
  file.root["extensionsUsed"].push_back("KHR_node_visibility");
  file.root["nodes"].push_back({{"mesh", 0}, {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}});
  file.root["scenes"][0]["nodes"] = {0, 1};
  animateNode(file, 1, "translation", {0, 3}, {0, 0, 0, 0, 0, 9});
  CHECK_FALSE(file.load(shutterFrom(1.1f, 0.8)).motion.any());
}

TEST_CASE("gltf shutter: flaws and extremes") {
  GltfFile file = unlitQuad();
  animateNode(file, 0, "translation", {0, 1}, {0, 0, 0, 1, 0, 0});
  // A shutter of years: the way takes next to none of it.
  const SceneData years = file.load(shutterFrom(0, 1e9));
  CHECK(shareCovered(years, 1.5) == doctest::Approx(1).epsilon(0.01));
  CHECK(file.load(shutterFrom(0, 1e-30)).motion.times.empty());
  CHECK(file.load(shutterFrom(5, 1)).motion.times.empty());
  // A clip of a thousand shakes is more than 16 pieces can tell: said, once.
  std::vector<float> times, values;
  for (int i = 0; i <= 1000; ++i) {
    times.push_back(static_cast<float>(i) / 1000);
    values.insert(values.end(), {static_cast<float>(i % 2), 0, 0});
  }
  GltfFile shaking = unlitQuad();
  animateNode(shaking, 0, "translation", times, values);
  const SceneData shaken = shaking.load(shutterFrom(0, 1));
  CHECK(shaken.motion.times.size() == 17);
  CHECK(hasWarning(shaken, "shorter --shutter"));
  // Vertices that are lost at another moment: the mesh stands still, and that is said.
  GltfFile lost = unlitQuad();
  const int target = lost.accessor<float>({3e38f, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC3");
  lost.primitive()["targets"] = {{{"POSITION", target}}};
  animateNode(lost, 0, "weights", {0, 1}, {0, 1});
  const SceneData halves = lost.load(shutterFrom(0, 1));
  CHECK(onlyMesh(halves).steps.empty());
  CHECK(hasWarning(halves, "stands still while the shutter"));
}

TEST_CASE("gltf shutter: far from zero, things move as near it") {
  const auto load = [](double far) {
    GltfFile file = unlitQuad();
    file.root["nodes"].push_back({{"children", {0}}, {"translation", {far, 0, 0}}});
    file.root["scenes"][0]["nodes"] = {1};
    const float f = static_cast<float>(far);
    animateNode(file, 1, "translation", {0, 1}, {f, 0, 0, f + 1, 0, 0});
    return file.load(shutterFrom(0, 1));
  };
  const SceneData near = load(0), far = load(1 << 20);
  CHECK(far.origin.x == doctest::Approx(1 << 20));
  CHECK(glm::length(placeAt(near, 0.5f) - placeAt(far, 0.5f)) < 1e-6f);
}

}  // namespace braid::test_gltf_shutter
