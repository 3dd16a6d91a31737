// SPDX-License-Identifier: Apache-2.0
// Renders with guided paths: right in the mean whatever the material, the same bits for any number of threads, crops
// and resumed runs included, with a variance that is true, and less of it where light comes round corners.
#include <doctest/doctest.h>

#include "integrators/guide_preparation.h"
#include "renderer/core/error.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/statistics/calibration.h"
#include "tests/support/statistics/pass_means.h"

namespace braid::test_guided_paths {

using namespace test;

namespace {

Settings guided(Settings s, Guiding guiding = Guiding::On) {
  s.guiding = guiding;
  return s;
}

Scene suiteScene(const std::string& name) { return Scene(loadGltf(sourcePath("scenes/" + name + ".glb"))); }

// The expectations of guided and unguided paths over blocks of pixels, clamped so that no rare path decides.
double disagreementOf(const Scene& scene, int width, int height, uint64_t spp, float clamp) {
  Settings with = guided(settingsOf("pt", width, height, spp, 1)),
           without = guided(settingsOf("pt", width, height, spp, 2), Guiding::Off);
  with.clamp = without.clamp = clamp;
  return disagreement(passMeans(scene, with, 4), passMeans(scene, without, 4));
}

std::shared_ptr<const GuidePreparation> prepared(const Scene& scene, const Settings& settings) {
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  const TransportContext context(scene, settings.lightStrategy);
  return std::make_shared<const GuidePreparation>(context, plan);
}

// A room in two halves: the lamp stands behind a wall that leaves a gap at its end, the camera before it.
SceneData roomWithScreen() {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.7f)), diffuseMaterial(Spectrum(0.1f), Spectrum(40))};
  for (Material& m : data.materials) m.doubleSided = true;
  TriangleMesh walls;
  addQuad(walls, {-2, 0, -4}, {4, 0, 0}, {0, 0, 8});
  addQuad(walls, {-2, 3, -4}, {4, 0, 0}, {0, 0, 8});
  addQuad(walls, {-2, 0, -4}, {4, 0, 0}, {0, 3, 0});
  addQuad(walls, {-2, 0, 4}, {4, 0, 0}, {0, 3, 0});
  addQuad(walls, {-2, 0, -4}, {0, 0, 8}, {0, 3, 0});
  addQuad(walls, {2, 0, -4}, {0, 0, 8}, {0, 3, 0});
  addQuad(walls, {-2, 0, 0}, {3.7f, 0, 0}, {0, 3, 0});
  addMesh(data, std::move(walls), 0);
  TriangleMesh lamp;
  addQuad(lamp, {-1.2f, 2, -2}, {0.4f, 0, 0}, {0, 0, 0.4f});
  addMesh(data, std::move(lamp), 1);
  data.cameras.push_back(cameraAt({-1.2f, 1.5f, 3.6f}, {0.5f, 1.2f, 0}));
  return data;
}

}  // namespace

TEST_CASE("guided paths: the mean is that of unguided ones") {
  CHECK(disagreementOf(Scene(cornellBox()), 12, 12, 800, 4) < 1);
  CHECK(disagreementOf(Scene(roomWithScreen()), 12, 8, 800, 4) < 1);
  // Metal, rough glass, clearcoat, sheen, transmission; solids with media; leaves that light passes; the sky.
  for (const char* name : {"materials", "glass_of_water", "plates", "foliage"}) {
    INFO(name);
    CHECK(disagreementOf(suiteScene(name), 12, 8, 500, 2) < 1);
  }
}

TEST_CASE("guided paths: another expectation is told apart") {
  const Scene box(cornellBox());
  Settings with = guided(settingsOf("pt", 12, 12, 800, 1)), without = settingsOf("pt", 12, 12, 800, 2);
  with.maxDepth = 4;
  CHECK(disagreement(passMeans(box, with, 4), passMeans(box, without, 4)) > 1);
}

TEST_CASE("guided paths: in a furnace every pixel has the radiance of the walls") {
  for (const double albedo : {0.3, 0.9}) {
    const Settings settings = guided(settingsOf("pt", 20, 20, 64));
    const double expected = 0.5 * (1 - std::pow(albedo, settings.maxDepth)) / (1 - albedo);
    CHECK(zScore(meanOf(render(furnace(static_cast<float>(albedo), 0.5f), settings)), expected) < kSigmas);
  }
}

TEST_CASE("guided paths: the same bits for any number of threads") {
  const Scene scene(roomWithScreen());
  std::vector<RenderResult> results;
  for (const int threads : {1, 2, 5}) {
    Settings settings = guided(settingsOf("pt", 48, 27, 6, 0, SamplerKind::Sobol));
    settings.threads = threads;
    results.push_back(render(scene, settings));
  }
  CHECK(sameBits(estimateOf(results[0]), estimateOf(results[1])));
  CHECK(sameBits(estimateOf(results[0]), estimateOf(results[2])));
}

TEST_CASE("guided paths: crops, resumed runs and later shares are those of the whole") {
  const Scene scene(roomWithScreen());
  const Settings settings = guided(settingsOf("pt", 48, 27, 8));
  const auto sessionOf = [&](const Settings& s) {
    return Session(scene, makePlan(scene, scene.data().cameras.at(0), s, integrators()));
  };
  Session whole = sessionOf(settings);
  const Rgb<float> image = whole.run().image;

  Settings part = settings;
  part.crop = PixelWindow{7, 5, 30, 20};
  const Rgb<float> crop = sessionOf(part).run().image;
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < crop.height(); ++y)
      for (int x = 0; x < crop.width(); ++x) CHECK(crop[c].at(x, y) == image[c].at(7 + x, 5 + y));

  part = settings;
  part.spp = 3;
  Session begun = sessionOf(part);
  begun.advance();
  Session resumed = sessionOf(settings);
  resumed.resume(begun.release(), "state");
  CHECK(sameBits(resumed.run().image, image));

  // Passes 0 … 3 and 4 … 7 by two machines: their mean is that of all eight.
  part.spp = 4;
  const Rgb<float> first = sessionOf(part).run().image;
  part.firstRound = 4;
  const Rgb<float> second = sessionOf(part).run().image;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < image.size(); ++i)
      CHECK(0.5f * (first[c][i] + second[c][i]) == doctest::Approx(image[c][i]).epsilon(1e-5));
}

TEST_CASE("guided paths: a state rendered without a guide is not gone on with one") {
  const Scene scene(roomWithScreen());
  const auto sessionOf = [&](Guiding guiding) {
    return Session(scene, makePlan(scene, scene.data().cameras.at(0), guided(settingsOf("pt", 20, 12, 2), guiding),
                                   integrators()));
  };
  Session off = sessionOf(Guiding::Off);
  off.advance();
  Session on = sessionOf(Guiding::On);
  CHECK_THROWS_AS(on.resume(off.release(), "state"), Error);
}

TEST_CASE("guided paths: light round a corner has less variance, and the decision says so") {
  const Scene scene(roomWithScreen());
  const Settings settings = settingsOf("pt", 160, 104, 8);
  const auto automatic = prepared(scene, settings);
  REQUIRE(automatic->decisions().size() == 1);
  INFO(automatic->decisions()[0].reason);
  CHECK(automatic->decisions()[0].kept);
  REQUIRE(automatic->guide() != nullptr);
  CHECK(automatic->guide()->bytes() < guidingBytes(makePlan(scene, scene.data().cameras[0], settings, integrators())));
  double variance[2] = {0, 0};
  for (int k = 0; k < 2; ++k) {
    Settings s = guided(settings, k == 0 ? Guiding::Off : Guiding::Automatic);
    s.clamp = 20;
    const RenderResult r = render(scene, s);
    for (const float v : estimateOf(r).variance[1].data) variance[k] += static_cast<double>(v);
  }
  MESSAGE("variance of unguided over guided paths: ", variance[0] / variance[1]);
  CHECK(variance[0] > 1.2 * variance[1]);
}

TEST_CASE("guided paths: left out where there is nothing to learn or to gain") {
  // Direct light alone; no light at all; small frames; short paths.
  SceneData dark = cornellBox();
  for (Material& m : dark.materials) m.emission = Spectrum(0);
  dark.lights.clear();
  const Scene black(std::move(dark));
  const Settings large = settingsOf("pt", 160, 104, 2);
  CHECK(prepared(black, large)->guide() == nullptr);
  const RenderResult r = render(black, guided(settingsOf("pt", 20, 12, 2)));
  CHECK(meanOf(r).value == 0);
  const Scene box(cornellBox());
  CHECK_FALSE(guidingApplies(makePlan(box, box.data().cameras[0], settingsOf("pt", 32, 18, 2), integrators())).yes);
  Settings shortPaths = guided(large);
  shortPaths.maxDepth = 2;
  CHECK_FALSE(guidingApplies(makePlan(box, box.data().cameras[0], shortPaths, integrators())).yes);
  CHECK_FALSE(guidingApplies(makePlan(box, box.data().cameras[0], guided(large, Guiding::Off), integrators())).yes);
  Settings sobol = large;
  sobol.guiding = Guiding::Automatic;
  sobol.sampler = SamplerKind::Sobol;
  CHECK_FALSE(guidingApplies(makePlan(box, box.data().cameras[0], sobol, integrators())).yes);
}

TEST_CASE("guided paths: scenes of any size and brightness are guided alike") {
  double expected = 0;
  for (const float scale : {1.0f, 1e-6f, 1e6f}) {
    SceneData data = roomWithScreen();
    for (TriangleMesh& mesh : data.meshes)
      for (Vec3& p : mesh.positions) p *= scale;
    for (CameraData& camera : data.cameras) camera.toWorld[3] = Vec4(Vec3(camera.toWorld[3]) * scale, 1);
    for (Material& m : data.materials) m.emission *= 1 / scale;
    const RenderResult r = render(Scene(std::move(data)), guided(settingsOf("pt", 24, 16, 64)));
    CHECK(r.rejected == 0);
    const double mean = meanOf(r).value * static_cast<double>(scale);
    if (scale == 1) expected = mean;
    CHECK(mean == doctest::Approx(expected).epsilon(0.2));
  }
}

TEST_CASE("guided paths: at most 64 MiB, whatever the frame") {
  const Scene box(cornellBox());
  for (const int size : {1, 33, 640, 4096, 16384}) {
    const Settings settings = guided(settingsOf("pt", size, size, 1));
    Plan plan;
    plan.settings = settings;
    CHECK(guidingBytes(plan) <= uint64_t(64) << 20);
  }
}

TEST_CASE("guided paths: the reported variance is true") {
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
    Settings settings = guided(settingsOf("pt", 24, 24, 16, 0, sampler));
    settings.clamp = 1;
    settings.threads = 1;
    checkCalibrated("cornell, guided", reportedOverEmpirical(Scene(cornellBox()), settings, 192));
  }
}

}  // namespace braid::test_guided_paths
