// SPDX-License-Identifier: Apache-2.0
// How light samples are shared between finite lights, directional ones and the environment, by what each brings.
#include <doctest/doctest.h>

#include "tests/support/render_fixture.h"

namespace braid::test_light_kinds {

using namespace test;

namespace {

constexpr size_t kFinite = 0, kDirectional = 1, kEnvironment = 2;

// A floor under a lamp and an environment; a roof, where there is one, hides the environment from all that is seen.
SceneData lampAndDome(float lamp, float dome, bool roof) {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.6f)), diffuseMaterial(Spectrum(0), Spectrum(lamp))};
  TriangleMesh floor, light, above;
  const float half = roof ? 500 : 1;
  addQuad(floor, {-half, 0, half}, {2 * half, 0, 0}, {0, 0, -2 * half});
  addQuad(light, {-0.2f, 1, -0.2f}, {0.4f, 0, 0}, {0, 0, 0.4f});
  addMesh(data, std::move(floor), 0);
  addMesh(data, std::move(light), 1);
  if (roof) {
    addQuad(above, {-half, 1.5f, -half}, {2 * half, 0, 0}, {0, 0, 2 * half});
    addMesh(data, std::move(above), 0);
  }
  data.environment = EnvironmentData{nullptr, Spectrum(dome), 0};
  data.cameras.push_back(cameraAt({0, 0.8f, 1.2f}, {0, 0, 0}));
  return data;
}

Plan planOf(const Scene& scene, uint64_t spp) {
  return makePlan(scene, scene.data().cameras[0], settingsFor(48, 32, spp), integrators());
}

// Mean over pixels of the relative variance that the render reports.
double noiseOf(const RenderResult& result) {
  const Estimate& e = estimateOf(result);
  double sum = 0;
  for (size_t i = 0; i < e.mean.size(); ++i)
    sum += static_cast<double>(e.variance[1][i]) / (sqr(static_cast<double>(e.mean[1][i])) + 1e-4);
  return sum / static_cast<double>(e.mean.size());
}

}  // namespace

TEST_CASE("Kinds of lights that bring nothing keep their even part of the light samples") {
  const Scene hidden(lampAndDome(10, 1, true));
  const Plan plan = planOf(hidden, 1);
  REQUIRE(plan.lightKinds);
  CHECK((*plan.lightKinds)[kFinite] == doctest::Approx(0.9).epsilon(0.01));
  CHECK((*plan.lightKinds)[kDirectional] == 0);
  CHECK((*plan.lightKinds)[kEnvironment] == doctest::Approx(0.1).epsilon(0.05));
  CHECK(plan.text().find("+ kinds of lights: 0.9 of the light samples for finite ones, 0 for directional ones, 0.1 for "
                         "the environment") != std::string::npos);
}

TEST_CASE("The share of a kind of lights grows with what it brings") {
  float before = 0;
  for (const float lamp : {1e-6f, 1.0f, 10.0f, 1e6f}) {
    CAPTURE(lamp);
    const Scene scene(lampAndDome(lamp, 1, false));
    const Plan plan = planOf(scene, 1);
    REQUIRE(plan.lightKinds);
    const LightKinds& kinds = *plan.lightKinds;
    CHECK(kinds[kFinite] + kinds[kEnvironment] == doctest::Approx(1));
    CHECK(kinds[kFinite] > before);
    before = kinds[kFinite];
  }
  CHECK(before == doctest::Approx(0.9).epsilon(1e-3));
}

TEST_CASE("A scene with one kind of lights, or none, measures nothing") {
  SceneData lampAlone = lampAndDome(10, 1, false), dark = lampAndDome(0, 1, false);
  lampAlone.environment.reset();
  dark.environment.reset();
  const Scene scenes[] = {Scene(std::move(lampAlone)), Scene(std::move(dark))};
  for (const Scene& scene : scenes) {
    const Plan plan = planOf(scene, 1);
    CHECK_FALSE(plan.lightKinds);
    CHECK(plan.text().find("- kinds of lights: one at most") != std::string::npos);
  }
}

TEST_CASE("Measured shares of light samples have less noise and the same expectation") {
  const Scene scene(lampAndDome(10, 1, true));
  Plan measured = planOf(scene, 64), even = measured;
  even.lightKinds.reset();
  const RenderResult a = Session(scene, measured).run(), b = Session(scene, even).run();
  CHECK(noiseOf(a) < 0.7 * noiseOf(b));
  Settings settings = settingsFor(48, 32, 64, SamplerKind::Independent);
  const RenderResult c = render(scene, settings);
  Plan plain = makePlan(scene, scene.data().cameras[0], settings, integrators());
  plain.lightKinds.reset();
  plain.settings.seed = 2;
  const RenderResult d = Session(scene, plain).run();
  CHECK(std::abs(zScore(meanOf(c), meanOf(d))) < zLimit(1));  // one false alarm in 10,000
}

}  // namespace braid::test_light_kinds
