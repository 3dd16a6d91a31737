// SPDX-License-Identifier: Apache-2.0
// Lights with a range (KHR_lights_punctual): the window is the same for every way of finding their light.
#include <doctest/doctest.h>

#include "renderer/transport/lights/light_sampler.h"
#include "tests/support/statistics/pass_means.h"

namespace braid::test_light_range {

using namespace test;

namespace {

PunctualLight lamp(PunctualKind kind, const Vec3& at, float range) {
  PunctualLight light;
  light.kind = kind;
  light.position = at;
  light.direction = glm::normalize(Vec3(0.2f, -0.9f, -0.4f));
  light.outerConeAngle = 0.8f;
  light.innerConeAngle = 0.3f;
  light.intensity = Spectrum(2, 1.5f, 1);
  light.range = range;
  return light;
}

SceneData litByRanges() {
  SceneData data = cornellBox();
  for (Material& m : data.materials) m.emission = Spectrum(0);
  data.lights = {lamp(PunctualKind::Point, {-0.5f, 0.5f, 0.4f}, 1.3f),
                 lamp(PunctualKind::Spot, {0.3f, 0.8f, 0.2f}, 1.9f),
                 lamp(PunctualKind::Point, {0.6f, -0.2f, 0.5f}, 0.7f)};
  return data;
}

// A floor seen at one spot, a light above it, and something between.
SceneData floorUnder(float height, float range) {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.6f))};
  TriangleMesh floor;
  addQuad(floor, {-5, 0, 5}, {10, 0, 0}, {0, 0, -10});
  addMesh(data, std::move(floor), 0);
  data.lights = {lamp(PunctualKind::Point, {0, height, 0}, range)};
  data.cameras = {spotCamera(Vec3(1, 1, 1), Vec3(0), 1e-3f)};
  return data;
}

double meanWith(SceneData data, const char* integrator, uint64_t spp) {
  Settings settings = settingsOf(integrator, 4, 4, spp);
  settings.maxDepth = 3;
  return meanOf(render(std::move(data), settings)).value;
}

}  // namespace

TEST_CASE("The light of a lamp with a range fades to nothing without an edge") {
  for (const float height : {0.5f, 1.0f, 1.9f, 1.999f}) {
    const double expected = 0.6 / 3.14159265 * 1.5 / sqr(static_cast<double>(height)) * (1 - std::pow(height / 2, 4));
    CHECK(meanWith(floorUnder(height, 2), "pt", 4) == doctest::Approx(expected).epsilon(1e-4));
  }
  CHECK(meanWith(floorUnder(2.1f, 2), "pt", 4) == 0);
  CHECK(meanWith(floorUnder(2.1f, 2), "bdpt", 4) == 0);
}

TEST_CASE("All integrators agree on lamps with ranges") {
  const Scene scene(litByRanges());
  for (const LightStrategy strategy : {LightStrategy::Hierarchy, LightStrategy::Power}) {
    Settings reference = settingsOf("pt", 24, 24, 256);
    reference.lightStrategy = strategy;
    const std::vector<Measured> expected = passMeans(scene, reference, 6);
    for (const char* integrator : {"bdpt", "crn", "gdpt"}) {
      CAPTURE(std::string(integrator));
      Settings settings = settingsOf(integrator, 24, 24, 64, 5);
      settings.lightStrategy = strategy;
      CHECK(disagreement(passMeans(scene, settings, 6), expected) < 1);
    }
  }
  // Consistent ones: within 2 % or four standard errors, whichever is wider.
  const Measured pt = meanOverSeeds(scene, settingsOf("pt", 32, 32, 64), 4, 1);
  for (const char* integrator : {"vcm", "sppm"}) {
    const Measured m = meanOverSeeds(scene, settingsOf(integrator, 32, 32, 64), 4, 1);
    CAPTURE(std::string(integrator));
    CHECK(std::abs(m.value - pt.value) < std::max(0.02 * pt.value, 4 * std::hypot(m.error, pt.error)));
  }
}

TEST_CASE("The window counts the whole straight way, also where walks from a light pass panes") {
  const auto underPane = [](float range) {
    SceneData data = floorUnder(1.5f, range);
    Material pane = diffuseMaterial(Spectrum(1));
    pane.transmission = 1;
    pane.specular = 0;
    pane.roughness = 0;
    data.materials.push_back(pane);
    TriangleMesh sheet;
    addQuad(sheet, {-5, 1, 5}, {10, 0, 0}, {0, 0, -10});
    addMesh(data, std::move(sheet), 1);
    data.cameras = {spotCamera(Vec3(0.5f, 0.5f, 0.5f), Vec3(0), 0.3f)};  // below the pane
    return meanWith(std::move(data), "bdpt", 4096);
  };
  const double all = underPane(kInfinity);
  REQUIRE(all > 0);
  // Over the spot the distance varies from 1.5 by less than the tolerance.
  CHECK(underPane(2) / all == doctest::Approx(1 - std::pow(1.5 / 2, 4)).epsilon(0.05));
}

TEST_CASE("The hierarchy chooses a lamp with a range wherever its light arrives") {
  SceneData data = litByRanges();
  const std::vector<PunctualLight> lamps = data.lights;
  const Scene scene(std::move(data));
  const LightSampler lights(scene, LightStrategy::Hierarchy);
  int missed = 0, useless = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p(std::cos(static_cast<float>(i)) * 0.9f, std::sin(2.7f * static_cast<float>(i)) * 0.9f,
                 std::sin(1.3f * static_cast<float>(i)) * 0.9f);
    for (uint32_t k = 0; k < 3; ++k) {
      const float window = rangeWindow(lamps[k], glm::length(p - lamps[k].position));
      const float chance = lights.pdfDirect(k, {p, Vec3(0), true}, Vec3(0, 1, 0));
      missed += lamps[k].kind == PunctualKind::Point && window > 0 && !(chance > 0);
      useless += window == 0 && chance > 0 && glm::length(p - lamps[k].position) > 1.001f * lamps[k].range;
    }
  }
  CHECK(missed == 0);
  CHECK(useless == 0);
}

}  // namespace braid::test_light_range
