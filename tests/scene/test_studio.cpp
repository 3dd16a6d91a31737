// SPDX-License-Identifier: Apache-2.0
// What files without a camera or a light get: a frame that the scene fills, a studio, and a neutral backdrop.
#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "renderer/scene/camera.h"
#include "renderer/scene/data/scene_defaults.h"
#include "renderer/scene/data/studio.h"
#include "renderer/session/default_light.h"
#include "tests/scene/scene_shapes.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"
#include "tests/support/running_braid.h"
#include "tools/options/turntable.h"

namespace braid::test_studio {

using namespace test;
using namespace test::scene_shapes;

namespace {

// Least and largest raster position of the scene's points, as parts of the frame.
struct Extent {
  Vec2 lo{1e9f}, hi{-1e9f};
};
void extend(Extent& e, const SceneData& data, const CameraData& camera, int width, int height) {
  const Camera view(camera, width, height);
  for (const MeshInstance& i : data.instances)
    for (const Vec3& p : data.meshes[i.mesh].positions) {
      const std::optional<Vec2> raster = view.project(Vec3(i.toWorld * Vec4(p, 1)));
      REQUIRE(raster);
      const Vec2 part = *raster / Vec2(static_cast<float>(width), static_cast<float>(height));
      e.lo = glm::min(e.lo, part);
      e.hi = glm::max(e.hi, part);
    }
}
Extent framed(const SceneData& data, int width, int height, float yfov = kDefaultYfov) {
  Extent e;
  extend(e, data, framingCamera(data, static_cast<float>(width) / static_cast<float>(height), yfov), width, height);
  return e;
}

SceneData sceneOf(TriangleMesh mesh) {
  SceneData data;
  data.materials.push_back(diffuseMaterial(Spectrum(0.5f)));
  addMesh(data, std::move(mesh), 0);
  return data;
}

// A ball that is drawn out and bent out of shape, somewhere.
SceneData potato(Rng& rng) {
  TriangleMesh mesh;
  const Vec3 size(std::exp(3 * rng.next() - 1.5f), std::exp(3 * rng.next() - 1.5f), std::exp(3 * rng.next() - 1.5f));
  addSphere(mesh, {0, 0, 0}, 1, 2);
  for (Vec3& p : mesh.positions) p = p * size * (0.5f + rng.next()) + Vec3(7, -3, 20);
  mesh.normals.clear();
  return sceneOf(std::move(mesh));
}

// A ball on a floor, seen by a camera of its own.
SceneData ballOnFloor() {
  SceneData data;
  data.materials.push_back(diffuseMaterial(Spectrum(0.6f)));
  TriangleMesh ball;
  addSphere(ball, {0, 0.5f, 0}, 0.5f, 3);
  addMesh(data, std::move(ball), 0);
  addMesh(data, quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}), 0);
  data.cameras = {cameraAt({1.2f, 1.5f, 2.2f}, {0, 0.4f, 0})};
  return data;
}

}  // namespace

TEST_CASE("Framing: what is seen spans 85 % of the frame, in its middle, whatever its shape and that of the frame") {
  Rng rng(9);
  for (int i = 0; i < 40; ++i) {
    const SceneData data = potato(rng);
    const int width = 100 + static_cast<int>(300 * rng.next());
    const Extent e = framed(data, width, 200, 0.3f + rng.next());
    CAPTURE(i);
    const Vec2 span = e.hi - e.lo, middle = 0.5f * (e.hi + e.lo);
    CHECK(std::max(span.x, span.y) == doctest::Approx(0.85).epsilon(0.003));
    CHECK(middle.x == doctest::Approx(0.5).epsilon(0.01));
    CHECK(middle.y == doctest::Approx(0.5).epsilon(0.01));
  }
}

TEST_CASE("Framing: while a turntable turns, all that is seen spans 85 % of the frame, in its middle") {
  Rng rng(10);
  for (int i = 0; i < 20; ++i) {
    const SceneData data = potato(rng);
    const int width = 100 + static_cast<int>(300 * rng.next()), height = 200;
    const float aspect = static_cast<float>(width) / static_cast<float>(height);
    const CameraData start = framingCamera(data, aspect, 0.3f + rng.next(), true);
    Extent e;
    for (int k = 0; k < 180; ++k) {
      CameraData camera = start;
      turnAbout(turntableAxis(worldBounds(data), data.origin), data.origin, k / 180.0, camera);
      extend(e, data, camera, width, height);
    }
    CAPTURE(i);
    const Vec2 span = e.hi - e.lo, middle = 0.5f * (e.hi + e.lo);
    CHECK(std::max(span.x, span.y) == doctest::Approx(0.85).epsilon(0.003));
    CHECK(middle.x == doctest::Approx(0.5).epsilon(0.01));
    CHECK(middle.y == doctest::Approx(0.5).epsilon(0.01));
  }
}

TEST_CASE("Framing: stray vertices and what cannot be seen do not count; the front is +Z") {
  SceneData data = sceneOf(cube());
  const CameraData alone = framingCamera(data);
  data.meshes[0].positions.emplace_back(1000, 0, 0);
  Material ghost = diffuseMaterial(Spectrum(1));
  ghost.alphaMode = AlphaMode::Blend;
  ghost.alpha = 0;
  data.materials.push_back(ghost);
  // Within the bounds of the stray vertex, which only place the numbers.
  addMesh(data, quad({-900, 0, 0}, {1, 0, 0}, {0, 1, 0}), 1);
  const CameraData camera = framingCamera(data);
  CHECK(glm::distance(Vec3(alone.toWorld[2]), glm::normalize(Vec3(0.55f, 0.4f, 1))) < 1e-5f);
  const Camera view(camera, 160, 90);
  for (int k = 0; k < 8; ++k) {
    const std::optional<Vec2> raster = view.project({k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1});
    REQUIRE(raster);
    CHECK((raster->y > 0.05f * 90 && raster->y < 0.95f * 90));
  }
}

TEST_CASE("Studio: its mean radiance is that of the dome, from the left above most of all") {
  const Environment studio(studioEnvironment(0.5f));
  Rng rng(5);
  double sum = 0;
  for (int i = 0; i < 200'000; ++i)
    sum += static_cast<double>(average(studio.radiance(squareToUniformSphere(rng.next2())))) / 200'000;
  CHECK(sum == doctest::Approx(0.5).epsilon(0.01));
  CHECK(average(studio.average()) == doctest::Approx(0.5).epsilon(0.002));
  const auto at = [&](const Vec3& d) { return average(studio.radiance(glm::normalize(d))); };
  CHECK(at({-0.57f, 1, 0.82f}) > 5 * at({0.57f, 1, 0.82f}));
  CHECK(at({1, 0.5f, -0.2f}) > at({0, 1, 0}));
  CHECK(at({0, 0.01f, 1}) > at({0, -1, 0}));
}

TEST_CASE("Studio: light that is left to surfaces makes less than half the noise") {
  // Variance over the squared values of what is seen: the lights are of the same power, but light other things.
  const auto noise = [](DefaultLight kind, bool leaves) {
    SceneData data = ballOnFloor();
    giveDefaultLight(data, kind);
    if (!leaves) data.environment->base = 0;
    const RenderResult r = render(std::move(data), settingsFor(96, 64, 64));
    double variance = 0, squares = 0;
    for (size_t i = 0; i < r.image.size(); ++i) {
      variance += static_cast<double>(estimateOf(r).variance[1][i]);
      squares += sqr(static_cast<double>(r.image[1][i]));
    }
    return variance / squares;
  };
  const double studio = noise(DefaultLight::Studio, true), dome = noise(DefaultLight::Dome, true);
  MESSAGE("relative variance under the studio over that under the dome: ", studio / dome);
  CHECK(studio < 0.5 * noise(DefaultLight::Studio, false));
  CHECK(studio < 5 * dome);
}

TEST_CASE("Studio: the camera sees the backdrop, mirrors see the studio, --background sees itself") {
  SceneData data = ballOnFloor();
  data.cameras = {cameraAt({0, 5, 0}, {0, 6, 0}, {0, 0, 1})};  // up, at nothing
  giveDefaultLight(data, DefaultLight::Studio, 2);
  REQUIRE(data.backdrop);
  const float backdrop = data.backdrop->x;
  Settings settings = settingsFor(8, 8, 1);
  for (const char* name : {"pt", "bdpt", "sppm"}) {
    settings.integrators = {name};
    const RenderResult r = render(data, settings);
    CHECK(r.image[1].at(4, 4) == doctest::Approx(backdrop).epsilon(1e-4));
  }
  settings.integrators = {"pt"};
  settings.background = Spectrum(0.25f);
  CHECK(render(data, settings).image[1].at(4, 4) == doctest::Approx(0.25).epsilon(1e-4));
  settings.background.reset();
  Material mirror = diffuseMaterial(Spectrum(1));
  mirror.metallic = 1;
  mirror.specular = 1;
  mirror.roughness = 0;
  data.materials.push_back(mirror);
  addMesh(data, quad({-4, 9, -4}, {8, 0, 0}, {0, 0, 8}), 1);  // reflects the nadir's paper past the small floor
  data.meshes.erase(data.meshes.begin(), data.meshes.begin() + 2);
  data.instances = {{0, Mat4(1), {}}};
  settings.spp = 16;
  const float seen = render(data, settings).image[1].at(4, 4);
  const Environment studio(*data.environment);
  CHECK(seen == doctest::Approx(average(studio.radiance({0, -1, 0}))).epsilon(0.1));
}

TEST_CASE("Default light: labels that shine on a thing do not light it") {
  SceneData data = ballOnFloor();
  data.materials.push_back(diffuseMaterial(Spectrum(0), Spectrum(1)));
  addMesh(data, quad({-0.3f, 0.001f, 1.5f}, {0.6f, 0, 0}, {0, 0, -0.4f}), 1);  // flat on the floor
  const CameraData camera = data.cameras[0];
  Scene scene(std::move(data));
  CHECK(lightIfDark(scene, camera, 160, 90));
  CHECK(scene.data().defaultLight);
  CHECK(scene.data().backdrop);
}

TEST_CASE("--default-light: studio, dome or none, told by info, plan and the header") {
  const Folder folder;
  GltfFile file = quadFile();
  folder.write("scene.glb", file.glb());
  const auto info = [&](const std::string& more) { return braidRun(folder, "info scene.glb --json" + more).out; };
  CHECK(contains(info(""), "\"defaultLight\": \"studio\""));
  CHECK(contains(info(" --default-light dome"), "\"defaultLight\": \"dome\""));
  for (const char* none : {" --default-light none", " --no-default-light"})
    CHECK(contains(info(none), "\"defaultLight\": null"));
  CHECK(contains(info(""), "\"defaultCamera\": true"));
  CHECK(contains(braidRun(folder, "plan scene.glb").out, "+ studio: made up"));
  const test::Run run = braidRun(folder, "render scene.glb -o o.exr --size 16x9 --spp 1");
  REQUIRE(run.code == 0);
  CHECK(contains(run.err, "a studio is added"));
  std::string light, camera;
  for (const Attribute& a : readImage(folder.path / "o.exr").attributes) {
    if (a.name == "braid/defaultLight") light = a.text;
    if (a.name == "braid/defaultCamera") camera = a.text;
  }
  CHECK(light == "studio");
  CHECK(camera == "framed");
  CHECK(braidRun(folder, "render scene.glb -o o.exr --default-light sun").code == 1);
}

}  // namespace braid::test_studio
