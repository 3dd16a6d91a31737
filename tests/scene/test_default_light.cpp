// SPDX-License-Identifier: Apache-2.0
// Files whose lights leave the picture dark get the default light, with a word of why; files that are lit do not.
#include <doctest/doctest.h>

#include "renderer/session/default_light.h"
#include "tests/support/command_line.h"
#include "tests/support/render_fixture.h"
#include "tools/bench/builtin_scenes.h"

namespace braid::test_default_light {

using namespace test;

namespace {

constexpr int kWidth = 64, kHeight = 36;

// A white floor of 2 x 2 m at y = 0, seen from a metre and a half above its edge.
SceneData floorScene() {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.8f), Spectrum(0))};
  TriangleMesh floor;
  addQuad(floor, {-1, 0, 1}, {2, 0, 0}, {0, 0, -2});
  addMesh(data, std::move(floor), 0);
  data.cameras = {cameraAt({0, 1.5f, 1.2f}, {0, 0, 0})};
  return data;
}

PunctualLight lightAt(PunctualKind kind, const Vec3& position, const Vec3& direction, float intensity) {
  PunctualLight light;
  light.kind = kind;
  light.position = position;
  light.direction = direction;
  light.intensity = Spectrum(intensity);
  return light;
}

// A square lamp about a point that shines down, or up.
void addLamp(SceneData& data, const Vec3& centre, float half, float radiance, bool down = true) {
  Material lamp = diffuseMaterial(Spectrum(0), Spectrum(radiance));
  lamp.doubleSided = false;
  data.materials.push_back(lamp);
  TriangleMesh mesh;
  const float turn = down ? 1.0f : -1.0f;
  addQuad(mesh, centre - Vec3(half, 0, half * turn), {2 * half, 0, 0}, {0, 0, 2 * half * turn});
  addMesh(data, std::move(mesh), static_cast<uint32_t>(data.materials.size() - 1));
}

struct Outcome {
  bool added = false;
  std::string text;
};

Outcome outcomeOf(SceneData data, float scale = 1) {
  const CameraData camera = data.cameras.at(0);
  Scene scene(std::move(data));
  const std::optional<std::string> text = lightIfDark(scene, camera, kWidth, kHeight, scale, DefaultLight::Dome);
  CHECK(scene.environment().has_value() == scene.traits().has(kTraitEnvironment));
  if (scene.data().defaultLight) CHECK(scene.environment()->average() == Spectrum(0.5f * scale));
  return {scene.data().defaultLight, text.value_or("")};
}

template <class Light>
Outcome withLight(const Light& light) {
  SceneData data = floorScene();
  light(data);
  return outcomeOf(std::move(data));
}

void checkDark(const Outcome& o) {
  INFO(o.text);
  CHECK(o.added);
  CHECK(contains(o.text, "% of what the camera sees"));
  CHECK(contains(o.text, "--no-default-light"));
}

void checkLit(const Outcome& o) {
  INFO(o.text);
  CHECK_FALSE(o.added);
  CHECK(o.text.empty());
}

}  // namespace

TEST_CASE("Default light: punctual lights count by what they light of the picture") {
  const auto with = [](const PunctualLight& light) { return withLight([&](SceneData& d) { d.lights = {light}; }); };
  const Vec3 above(0, 1, 0), down(0, -1, 0);
  checkLit(with(lightAt(PunctualKind::Point, above, down, 1)));
  checkLit(with(lightAt(PunctualKind::Spot, above, down, 1)));
  checkLit(with(lightAt(PunctualKind::Directional, above, down, 1)));

  PunctualLight shortRange = lightAt(PunctualKind::Point, above, down, 1);
  shortRange.range = 0.001f;
  checkDark(with(shortRange));
  checkDark(with(lightAt(PunctualKind::Spot, above, Vec3(0, 1, 0), 1)));
  checkDark(with(lightAt(PunctualKind::Directional, above, Vec3(0, 1, 0), 1)));
  checkDark(with(lightAt(PunctualKind::Point, Vec3(1000, 1, 0), down, 1)));
  PunctualLight needle = lightAt(PunctualKind::Spot, above, down, 1000);
  needle.outerConeAngle = 0.001f;
  checkDark(with(needle));
}

TEST_CASE("Default light: lamps count by what they light of the picture, whatever the unit of light") {
  const auto lamp = [](const Vec3& at, float half, float radiance, bool down = true) {
    return withLight([&](SceneData& d) { addLamp(d, at, half, radiance, down); });
  };
  const Vec3 above(0, 1.6f, 0);
  for (const float unit : {1e-12f, 1e-6f, 1.0f, 1e6f}) checkLit(lamp(above, 0.3f, 8 * unit));
  checkLit(lamp(above, 0.005f, 8 * sqr(0.3f / 0.005f)));
  checkDark(lamp(above, 0.3f, 8, false));                   // shines away
  checkDark(lamp(Vec3(0, 3, 4), 0.3f, 8, false));           // behind the camera
  checkDark(lamp(Vec3(0, 0.01f, 0), 0.001f, 1));            // a light-emitting diode close to the floor
  checkDark(lamp(Vec3(0.5f, 0.01f, 0), 0.001f, 1, false));  // the same, seen
  checkLit(withLight([](SceneData& d) { d.materials[0].emission = Spectrum(0.3f); }));  // baked light
}

TEST_CASE(
    "Default light: a lamp in a closed box lights nothing, light that comes round a corner or through glass counts") {
  const auto closed = [](SceneData& d, const Material& shell) {
    addLamp(d, {0, 1.02f, 0}, 0.05f, 2000);
    d.materials.push_back(shell);
    TriangleMesh ball;
    addSphere(ball, {0, 1, 0}, 0.2f, 3);
    addMesh(d, std::move(ball), static_cast<uint32_t>(d.materials.size() - 1));
  };
  checkDark(withLight([&](SceneData& d) { closed(d, diffuseMaterial(Spectrum(0.5f), Spectrum(0))); }));
  Material glass = diffuseMaterial(Spectrum(1), Spectrum(0));
  glass.transmission = 1;
  glass.roughness = 0;
  glass.thinWalled = false;
  glass.specular = 1;
  checkLit(withLight([&](SceneData& d) { closed(d, glass); }));

  // A lamp that shines at a ceiling only.
  checkLit(withLight([](SceneData& d) {
    addLamp(d, {0, 1.7f, 0}, 0.3f, 8, false);
    TriangleMesh ceiling;
    addQuad(ceiling, {-1, 2, 1}, {2, 0, 0}, {0, 0, -2});
    addMesh(d, std::move(ceiling), 0);
  }));
}

TEST_CASE("Default light: an emissive texture counts by the texels that triangles cover") {
  const auto textured = [](float u0, float u1) {
    SceneData data = floorScene();
    auto image = std::make_shared<Image>();
    image->width = 2;
    image->height = image->channels = 1;
    image->bytes = {0, 255};
    data.textures.emplace_back(image, true, Wrap::Clamp, Wrap::Clamp, Filter::Nearest);
    data.materials[0].emission = Spectrum(1);
    data.materials[0].emissiveTexture.texture = 0;
    data.meshes[0].uv[0] = {{u0, 0}, {u1, 0}, {u1, 1}, {u0, 1}};
    return outcomeOf(std::move(data));
  };
  checkLit(textured(0, 1));
  checkDark(textured(0.05f, 0.45f));
}

TEST_CASE("Default light: nothing is added where nothing seen needs light, nor to an environment") {
  SceneData unlit = floorScene();
  unlit.materials[0].unlit = true;
  unlit.lights = {lightAt(PunctualKind::Directional, {}, {0, 1, 0}, 1)};
  checkLit(outcomeOf(unlit));

  SceneData away = floorScene();
  away.lights = {lightAt(PunctualKind::Directional, {}, {0, 1, 0}, 1)};
  away.cameras = {cameraAt({0, 1, 0}, {0, 2, 0}, {0, 0, 1})};
  checkLit(outcomeOf(away));

  SceneData sky = floorScene();
  sky.environment = EnvironmentData{nullptr, Spectrum(1e-9f), 0};
  const CameraData camera = sky.cameras[0];
  Scene scene(std::move(sky));
  CHECK_FALSE(lightIfDark(scene, camera, kWidth, kHeight));
  CHECK(scene.environment()->average() == Spectrum(1e-9f));
}

TEST_CASE("Default light: it follows --light-scale, and a room that it cannot enter is named") {
  SceneData data = floorScene();
  data.lights = {lightAt(PunctualKind::Point, {1000, 1, 0}, {}, 1)};
  CHECK(outcomeOf(data, 8).added);
  CHECK_FALSE(outcomeOf(data, 0).added);

  TriangleMesh room;
  addSphere(room, {0, 0, 0}, 5, 2);
  SceneData inside = floorScene();
  inside.environment = EnvironmentData{nullptr, Spectrum(0.5f), 0};
  inside.defaultLight = true;
  CHECK(outcomeOf(inside).text.empty());
  addMesh(inside, std::move(room), 0);
  CHECK(contains(outcomeOf(inside).text, "the picture stays dark"));

  Material label = inside.materials[0];
  label.unlit = true;
  inside.materials.push_back(label);
  TriangleMesh board;
  addQuad(board, {-1, 0.01f, 1}, {1.2f, 0, 0}, {0, 0, -2});
  addMesh(inside, std::move(board), 1);
  CHECK(outcomeOf(inside).text.empty());  // the unlit board is to be seen
}

TEST_CASE("Default light: files whose lights or textures are black have none") {
  // One RGB pixel: `value` three times, with the checksums of the file.
  const auto png = [](std::vector<uint8_t> data) {
    std::vector<uint8_t> bytes(tinyPng().begin(), tinyPng().begin() + 33);
    for (const char b : std::string("\0\0\0\x0cIDAT", 8)) bytes.push_back(static_cast<uint8_t>(b));
    bytes.insert(bytes.end(), data.begin(), data.end());
    bytes.insert(bytes.end(), tinyPng().end() - 12, tinyPng().end());
    return bytes;
  };
  const std::vector<uint8_t> black{0x78, 0xda, 0x63, 0x60, 0x60, 0x60, 0x00, 0x00,
                                   0x00, 0x04, 0x00, 0x01, 0xc8, 0xea, 0xeb, 0xf9};
  const std::vector<uint8_t> lossyBlack{0x78, 0xda, 0x63, 0x60, 0x62, 0x62, 0x02, 0x00,
                                        0x00, 0x10, 0x00, 0x07, 0xa2, 0xd4, 0xf2, 0x3f};
  const auto emissive = [](const std::vector<uint8_t>& image) {
    GltfFile file = quadFile();
    const int source = file.append("images", {{"bufferView", file.view(image)}, {"mimeType", "image/png"}});
    const int texture = file.append("textures", {{"source", source}});
    giveMaterial(file, {{"emissiveFactor", {1, 1, 1}}, {"emissiveTexture", {{"index", texture}}}});
    return file.load();
  };
  for (const auto& data : {black, lossyBlack}) {
    const SceneData scene = emissive(png(data));
    CHECK(scene.defaultLight);
    CHECK(hasWarning(scene, "the lights of the file emit nothing"));
    CHECK(hasWarning(scene, "--no-default-light"));
  }
  CHECK_FALSE(emissive(tinyPng()).defaultLight);

  GltfFile dark = quadFile();
  dark.root["extensionsUsed"] = {"KHR_lights_punctual"};
  dark.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"intensity", 0}},
                                                              {{"type", "directional"}, {"color", {0, 0, 0}}}};
  for (int i = 0; i < 2; ++i) dark.root["nodes"].push_back({{"extensions", {{"KHR_lights_punctual", {{"light", i}}}}}});
  dark.root["scenes"][0]["nodes"] = {0, 1, 2};
  CHECK(dark.load().defaultLight);
  dark.root["extensions"]["KHR_lights_punctual"]["lights"][1]["color"] = {0, 0.5, 0};
  CHECK_FALSE(dark.load().defaultLight);
}

TEST_CASE("Default light: a picture that stays dark is told where no light may be added") {
  const auto told = [](const SceneData& data, DefaultLight kind) {
    Scene scene(data);
    const std::string text = lightIfDark(scene, data.cameras.at(0), kWidth, kHeight, 1, kind).value_or("");
    CHECK_FALSE(scene.data().defaultLight);
    return text;
  };
  SceneData data = floorScene();
  CHECK(contains(told(data, DefaultLight::None), "the file has no light: the picture stays dark (--default-light"));
  data.lights = {lightAt(PunctualKind::Spot, {0, 1, 0}, {0, 1, 0}, 1)};
  CHECK(contains(told(data, DefaultLight::None), "light 0 % of what the camera sees: the picture stays dark"));
  data.environment = EnvironmentData{nullptr, Spectrum(0), 0};
  for (const DefaultLight kind : {DefaultLight::None, DefaultLight::Studio})
    CHECK(contains(told(data, kind), "the environment is black, and the lights of the file light 0 %"));
  data.lights[0].direction = {0, -1, 0};
  CHECK(told(data, DefaultLight::None).empty());
  data.environment.reset();
  CHECK(told(data, DefaultLight::None).empty());
  data.lights.clear();
  data.materials[0].unlit = true;
  CHECK(told(data, DefaultLight::None).empty());
}

TEST_CASE("Default light: no scene of the suite gets one") {
  for (const char* name : {"cornell", "door_ajar", "pool", "glass_of_water", "plates", "interior", "foliage"}) {
    CAPTURE(std::string(name));
    Scene scene(loadGltf(sourcePath("scenes/" + std::string(name) + ".glb")));
    CHECK_FALSE(lightIfDark(scene, scene.data().cameras.at(0), 320, 180));
  }
}

TEST_CASE("Default light: every command decides alike, for the camera that was chosen") {
  // A lamp that only the second camera's floor is lit by.
  const Folder folder;
  GltfFile file = quadFile();
  file.root["extensionsUsed"] = {"KHR_lights_punctual"};
  file.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"intensity", 1}, {"range", 3}}};
  file.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}}}};
  file.root["nodes"] = {{{"mesh", 0}},
                        {{"mesh", 0}, {"translation", {50, 0, 0}}},
                        {{"translation", {50.5, 0.5, 1}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}},
                        {{"name", "dark"}, {"camera", 0}, {"translation", {0.5, 0.5, 2}}},
                        {{"name", "lit"}, {"camera", 0}, {"translation", {50.5, 0.5, 2}}}};
  file.root["scenes"][0]["nodes"] = {0, 1, 2, 3, 4};
  folder.write("scene.glb", file.glb());
  const std::string options = " --size 32x18 --spp 4 --integrator pt --combine none --default-light dome ";
  const auto plan = [&](const std::string& camera, const std::string& more = "") {
    const Run run = braidRun(folder, "plan scene.glb --json" + options + "--camera " + camera + more);
    CHECK(run.code == 0);
    CHECK(contains(run.out, "\"environment\"") == contains(run.err, "grey dome"));
    return contains(run.out, "\"environment\"");
  };
  CHECK(plan("dark"));
  CHECK_FALSE(plan("lit"));
  CHECK_FALSE(plan("dark", " --no-default-light"));
  CHECK(contains(braidRun(folder, "info scene.glb --json --default-light dome --camera dark").out, "grey dome"));
  CHECK_FALSE(contains(braidRun(folder, "info scene.glb --json --default-light dome --camera lit").out, "grey dome"));
  CHECK(contains(braidRun(folder, "replay scene.glb --pass 0 --pixel 16,9 --size 32x18 --default-light dome").err,
                 "grey dome"));

  const Run whole = braidRun(folder, "render scene.glb -o whole.exr --reproducible" + options);
  CHECK(contains(whole.err, "warning: scene.glb: the lights of the file light 0 % of what the camera sees"));
  for (const char* part : {"0:2", "2:4"}) {
    const std::string name = part[0] == '0' ? "a" : "b";
    CHECK(braidRun(folder,
                   "render scene.glb -q --size 32x18 --integrator pt --combine none --default-light dome --passes " +
                       std::string(part) + " --checkpoint " + name + ".state")
              .code == 0);
  }
  CHECK(braidRun(folder, "merge a.state b.state -o merged.exr").code == 0);
  CHECK(braidRun(folder, "compare merged.exr whole.exr --metric MSE --max 0").code == 0);
  const Run other = braidRun(folder, "render scene.glb --resume a.state -o c.exr --no-default-light" + options);
  CHECK(other.code == 2);
  CHECK(contains(other.err, "default"));
}

}  // namespace braid::test_default_light
