// SPDX-License-Identifier: Apache-2.0
// EXT_lights_image_based: cubes of PNGs become environments.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/scene/environment.h"
#include "tests/scene/gltf/gltf_lenient.h"
#include "tests/support/render_fixture.h"
#include "tests/support/textures/cube_file.h"

namespace braid::test_gltf_image_based {

using namespace test;
using test::gltf_lenient::hasNote;

namespace {

using Bytes = std::vector<uint8_t>;
constexpr const char* kName = kImageBased;

double linear(uint8_t b) {
  const double v = b / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

uint8_t encoded(double v) {
  return static_cast<uint8_t>(std::lround(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055)));
}

Json& light(GltfFile& file) { return file.root["extensions"][kName]["lights"][0]; }

Environment environmentOf(const SceneData& scene) {
  REQUIRE(scene.environment);
  CHECK(scene.environment->ofFile);
  CHECK_FALSE(scene.defaultLight);
  return Environment(*scene.environment);
}

// RGBD of (3, 1.43…, 0.72…).
const Bytes kBright{255, 183, 134, 85};
const Vec3 kAxes[] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};

// OpenGL 4.6, table 8.19: where s, from left to right, and t, down, lie on a face.
Vec3 openGl(size_t face, float s, float t) {
  const Vec3 directions[] = {{1, -t, -s}, {-1, -t, s}, {s, 1, t}, {s, -1, -t}, {s, -t, 1}, {-s, -t, -1}};
  return directions[face];
}

Vec3 randomDirection(Rng& rng) { return squareToUniformSphere(rng.next2()); }

// Coefficients of radiance a + b d.y, by hand.
Json coefficientsOf(double a, double b) {
  Json rows = Json::array();
  for (int k = 0; k < 9; ++k) {
    const double c = k == 0   ? a / 0.28209479 * static_cast<double>(kPi)
                     : k == 1 ? b / 0.48860251 * static_cast<double>(kPi) * 2 / 3
                              : 0.0;
    rows.push_back({c, c, c});
  }
  return rows;
}

}  // namespace

TEST_CASE("image-based light: a constant cube is a constant environment") {
  GltfFile file = cubeFile(4, [](size_t, int, int) { return kBright; });
  light(file)["intensity"] = 2;
  light(file)["rotation"] = {0.1, 0.2, 0.3, 0.9};
  SceneData scene = file.load();
  const Environment environment = environmentOf(scene);
  const double expected[] = {2.0 * 3, 2.0 * 3 * linear(183), 2.0 * 3 * linear(134)};
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    const Spectrum radiance = environment.radiance(randomDirection(rng));
    for (int c = 0; c < 3; ++c) CHECK(static_cast<double>(radiance[c]) == doctest::Approx(expected[c]).epsilon(1e-5));
  }
  CHECK(environment.average().y == doctest::Approx(expected[1]).epsilon(1e-5));
  // The same picture as under the dome of that radiance.
  scene.cameras = {cameraAt({0.5f, 0.5f, 2}, {0.5f, 0.5f, 0})};
  SceneData dome = scene;
  dome.environment = EnvironmentData{nullptr, Spectrum(glm::dvec3(expected[0], expected[1], expected[2])), 0};
  const Settings settings = settingsFor(12, 12, 64);
  const RenderResult a = render(std::move(scene), settings), b = render(std::move(dome), settings);
  for (size_t c = 0; c < 3; ++c) CHECK(zScore(meanOf(a, c), meanOf(b, c)) < kSigmas);
}

TEST_CASE("image-based light: faces lie as the specification says, and turn with the rotation") {
  // Each face has a grey of its own, its upper left quarter is white.
  const auto grey = [](size_t face) { return static_cast<uint8_t>(60 + 30 * face); };
  GltfFile file = cubeFile(16, [&](size_t face, int x, int y) {
    const uint8_t v = x < 8 && y < 8 ? 255 : grey(face);
    return Bytes{v, v, v};
  });
  const auto check = [&](const glm::dquat& rotation) {
    const SceneData scene = file.load();
    const Environment environment = environmentOf(scene);
    CHECK_FALSE(hasWarning(scene, "faces do not meet"));
    for (size_t face = 0; face < 6; ++face) {
      CAPTURE(face);
      for (const float x : {-0.5f, 0.5f})
        for (const float y : {-0.5f, 0.5f}) {
          // Mirrored against OpenGL: what is left has a positive s.
          const Vec3 d = Mat3(glm::mat3_cast(rotation)) * glm::normalize(openGl(face, -x, y));
          const double expected = x < 0 && y < 0 ? 1.0 : linear(grey(face));
          CHECK(static_cast<double>(environment.radiance(d).y) == doctest::Approx(expected).epsilon(1e-4));
        }
    }
  };
  check(glm::dquat(1, 0, 0, 0));
  const double h = std::sqrt(0.5);
  // About +Y, +X comes to lie in -Z.
  light(file)["rotation"] = {0, h, 0, h};
  CHECK(static_cast<double>(environmentOf(file.load()).radiance(glm::normalize(Vec3(0.3f, -0.3f, -1))).y) ==
        doctest::Approx(linear(grey(0))).epsilon(1e-4));
  check(glm::dquat(h, 0, h, 0));
  light(file)["rotation"] = {0.2, -0.4, 0.6, 1.4};  // of any length
  check(glm::normalize(glm::dquat(1.4, 0.2, -0.4, 0.6)));
  light(file)["rotation"] = {0, 0, 0, 0};
  CHECK(hasWarning(file.load(), "/lights/0/rotation: is zero"));
}

TEST_CASE("image-based light: faces that meet only as other programs write them are read so, with a warning") {
  const auto radiance = [](const Vec3& d) {
    return 0.5 + static_cast<double>(0.2f * d.x + 0.15f * d.y + 0.1f * d.z * d.x - 0.1f * d.y * d.z);
  };
  struct Case {
    float mirrorX, s, t;  // signs: +X lies in -X; how pixels run against OpenGL's
    bool isWarned;
  };
  for (const Case& c : {Case{1, -1, 1, false}, Case{-1, 1, -1, true}, Case{-1, 1, 1, true}}) {
    CAPTURE(c.s);
    CAPTURE(c.t);
    const SceneData scene = cubeFile(16, [&](size_t face, int x, int y) {
                              const float s = (static_cast<float>(x) + 0.5f) / 8 - 1;
                              const float t = (static_cast<float>(y) + 0.5f) / 8 - 1;
                              const Vec3 d = glm::normalize(openGl(face, c.s * s, c.t * t));
                              const uint8_t v = encoded(radiance({c.mirrorX * d.x, d.y, d.z}));
                              return Bytes{v, v, v};
                            }).load();
    CHECK(hasWarning(scene, "/extensions/EXT_lights_image_based/lights/0/specularImages: faces do not meet as") ==
          c.isWarned);
    const Environment environment = environmentOf(scene);
    Rng rng(5);
    for (int i = 0; i < 200; ++i) {
      const Vec3 d = randomDirection(rng);
      CHECK(static_cast<double>(environment.radiance(d).x) == doctest::Approx(radiance(d)).epsilon(0.03));
    }
  }
}

TEST_CASE("image-based light: every integrator finds the bright face where its latitude-longitude twin has it" *
          doctest::test_suite("statistics")) {
  const auto isBright = [](const Vec3& d) { return d.x > std::abs(d.y) && d.x > std::abs(d.z); };
  GltfFile file = cubeFile(64, [](size_t face, int, int) {
    return face == 0 ? Bytes{255, 255, 255, 51} : Bytes{124, 124, 124, 255};  // 5 and 0.202…
  });
  const glm::dquat turn = glm::normalize(glm::dquat(0.6, -0.3, 0.5, 0.4));
  light(file)["rotation"] = {turn.x, turn.y, turn.z, turn.w};
  SceneData scene = file.load();
  scene.meshes.clear();
  scene.instances.clear();
  scene.materials = {diffuseMaterial(Spectrum(0.7f))};
  TriangleMesh sphere;
  addSphere(sphere, Vec3(0), 1, 2);
  addQuad(sphere, {-2, -1, 2}, {4, 0, 0}, {0, 0, -4});
  sphere.normals.clear();
  addMesh(scene, std::move(sphere), 0);
  scene.cameras = {cameraAt({1, 2, 4}, Vec3(0))};
  SceneData twin = scene;
  auto image = std::make_shared<Image>();
  image->width = 1024;
  image->height = 512;
  image->channels = 1;
  for (int y = 0; y < image->height; ++y)
    for (int x = 0; x < image->width; ++x) {
      const float theta = kPi * (static_cast<float>(y) + 0.5f) / 512;
      const float phi = 2 * kPi * ((static_cast<float>(x) + 0.5f) / 1024 - 0.5f);
      const Vec3 d(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi));
      image->floats.push_back(isBright(Vec3(glm::inverse(turn) * glm::dvec3(d))) ? 5.0f
                                                                                 : static_cast<float>(linear(124)));
    }
  twin.environment = EnvironmentData{image, Spectrum(1), 0};
  const Scene withCube(std::move(scene)), withTwin(std::move(twin));
  Settings settings = settingsFor(16, 16, 32);
  settings.integrators = {"pt"};
  const Measured expected = meanOverSeeds(withTwin, settings, 6, 100);
  for (const Integrator* integrator : integrators()) {
    settings.integrators = {integrator->name()};
    CAPTURE(std::string(integrator->name()));
    const Measured m = meanOverSeeds(withCube, settings, 6, 7);
    // Photons blur; the edge of the face is as wide as a texel.
    const double allowed = (integrator->unbiased() ? 0.002 : 0.02) * expected.value;
    CHECK(std::abs(m.value - expected.value) < allowed + kSigmas * std::hypot(m.error, expected.error));
  }
}

TEST_CASE("image-based light: without images the irradiance coefficients light, with a warning") {
  GltfFile file = cubeFile(4, [](size_t, int, int) { return kBright; });
  light(file)["irradianceCoefficients"] = coefficientsOf(2, 1);
  light(file).erase("specularImages");
  const SceneData scene = file.load();
  CHECK(hasWarning(scene, "specularImages/0: lists no six images"));
  CHECK(hasWarning(scene, "its irradiance coefficients light the scene"));
  const Environment environment = environmentOf(scene);
  Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    const Vec3 d = randomDirection(rng);
    CHECK(environment.radiance(d).x == doctest::Approx(2 + d.y).epsilon(0.005));
  }
  // What would be negative is dark.
  light(file)["irradianceCoefficients"] = coefficientsOf(0.5, 1);
  CHECK(environmentOf(file.load()).radiance({0, -1, 0}).x == 0);
}

TEST_CASE("image-based light: a flaw costs that light, and the default light decides") {
  const auto flawed = [](const std::function<void(GltfFile&)>& spoil, const std::string& warning) {
    GltfFile file = cubeFile(4, [](size_t, int, int) { return kBright; });
    spoil(file);
    const SceneData scene = gltf_lenient::loadWarned(file, warning, GltfFile::plainLight());
    CHECK(scene.defaultLight);
    // With coefficients beside it, these light.
    light(file)["irradianceCoefficients"] = coefficientsOf(1, 0);
    return file.load().environment->ofFile;
  };
  const std::string at = "/extensions/EXT_lights_image_based/lights/0";
  CHECK(flawed([](GltfFile& f) { light(f)["specularImages"][0].erase(5); }, at + "/specularImages/0: is 5 entries"));
  CHECK(flawed([](GltfFile& f) { light(f)["specularImages"][0][2] = 99; }, at + "/specularImages/0/2: is 99"));
  CHECK(flawed([](GltfFile& f) { light(f)["specularImages"] = "cube.png"; }, at + "/specularImages: is the text"));
  CHECK(flawed([](GltfFile& f) { light(f)["specularImages"] = Json::array(); }, "lists no six images"));
  CHECK(flawed([](GltfFile& f) { f.root["images"][3] = {{"uri", "missing.png"}}; }, "/images/3"));
  const auto wide = [](GltfFile& f) {
    const Bytes png = pngOf(4, 2, Bytes(24, 90));
    f.root["images"][1] = {{"bufferView", f.view(png)}, {"mimeType", "image/png"}};
  };
  CHECK(flawed(wide, at + "/specularImages/0/1: is 4 x 2 pixels"));
  const auto other = [](GltfFile& f) {
    const Bytes png = pngOf(2, 2, Bytes(12, 90));
    f.root["images"][4] = {{"bufferView", f.view(png)}, {"mimeType", "image/png"}};
  };
  CHECK(flawed(other, at + "/specularImages/0/4: is 2 x 2 pixels"));
}

TEST_CASE("image-based light: coefficients that are no numbers, lights that do not exist, lights that nothing uses") {
  GltfFile file = cubeFile(4, [](size_t, int, int) { return kBright; });
  light(file).erase("specularImages");
  light(file)["irradianceCoefficients"] = coefficientsOf(1, 0);
  light(file)["irradianceCoefficients"][4][1] = nullptr;  // NaN, as JSON writes it
  SceneData scene = file.load();
  CHECK(hasWarning(scene, "/irradianceCoefficients/4/1: is null"));
  CHECK(hasWarning(scene, "the light is left out"));
  CHECK(scene.defaultLight);
  file.root["scenes"][0]["extensions"][kName]["light"] = 3;
  scene = file.load();
  CHECK(hasWarning(scene, "/scenes/0/extensions/EXT_lights_image_based/light: is 3"));
  CHECK(scene.defaultLight);
  GltfFile black = cubeFile(4, [](size_t, int, int) { return Bytes{0, 0, 0}; });
  CHECK(hasWarning(black.load(), "a light is black"));
  CHECK(black.load().defaultLight);
  file.root["scenes"][0].erase("extensions");
  scene = file.load();
  CHECK(hasNote(scene, "/irradianceCoefficients/4/1: is null"));
  CHECK_FALSE(hasWarning(scene, "irradiance"));
}

}  // namespace braid::test_gltf_image_based
