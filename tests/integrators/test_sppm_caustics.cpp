// SPDX-License-Identifier: Apache-2.0
// Caustics in glossy reflections, which photon mapping finds by hitting the light and by photons: both together find
// all of that light once, whatever the size of the lamp and the sharpness of the reflection.
// Differences may go to 2 % and kSigmas standard errors (4: a false alarm in 16,000 checks, and the seeds are fixed).
#include <cmath>
#include <string>

#include <doctest/doctest.h>

#include "tests/support/render_fixture.h"

namespace braid::test_sppm_caustics {

using namespace test;

namespace {

// A metal floor under a glass ball, seen from above; black but for what a lamp sends.
SceneData glossyFloor(float roughness) {
  SceneData data;
  Material floor = diffuseMaterial(Spectrum(0.9f, 0.7f, 0.5f));
  floor.specular = 1;
  floor.metallic = 1;
  floor.roughness = roughness;
  Material glass = diffuseMaterial(Spectrum(1));
  glass.specular = 1;
  glass.roughness = 0;
  glass.transmission = 1;
  glass.thinWalled = false;
  glass.doubleSided = false;
  data.materials = {floor, glass};
  TriangleMesh quad, ball;
  addQuad(quad, {-2, 0, 2}, {4, 0, 0}, {0, 0, -4});
  addSphere(ball, {0, 0.6f, 0}, 0.4f, 4);
  addMesh(data, std::move(quad), 0);
  addMesh(data, std::move(ball), 1);
  // Beside the ball, where the floor mirrors light that came through it.
  data.cameras.push_back(cameraAt({0.9f, 1.6f, 0.3f}, {0.25f, 0, 0}));
  return data;
}

void addLamp(SceneData& data, float side, float power) {
  Material lamp = diffuseMaterial(Spectrum(0), Spectrum(power / sqr(side)));
  lamp.doubleSided = false;
  data.materials.push_back(lamp);
  TriangleMesh quad;
  addQuad(quad, {-1.2f - side / 2, 2, -side / 2}, {side, 0, 0}, {0, 0, side});
  addMesh(data, std::move(quad), static_cast<int>(data.materials.size()) - 1);
}

void addPoint(SceneData& data) {
  PunctualLight light;
  light.kind = PunctualKind::Point;
  light.position = {-1.2f, 2, 0};
  light.intensity = Spectrum(3);
  data.lights.push_back(light);
}

Settings settingsOf(const char* integrator, uint64_t spp) {
  Settings s = settingsFor(24, 24, spp);
  s.integrators = {integrator};
  s.photons = 20000;
  s.photonRadius = 0.5f;
  s.maxDepth = 8;
  return s;
}

}  // namespace

TEST_CASE("sppm caustics: lamps of any size in reflections of any sharpness, as bdpt finds them") {
  struct Lamp {
    const char* name;
    float side;  // metres; 0: a point
  };
  for (const Lamp& lamp : {Lamp{"a point", 0}, Lamp{"0.03 m", 0.03f}, Lamp{"0.3 m", 0.3f}, Lamp{"1.5 m", 1.5f}})
    for (const float roughness : {0.25f, 0.32f, 0.45f}) {
      SceneData data = glossyFloor(roughness);
      if (lamp.side > 0)
        addLamp(data, lamp.side, 3);
      else
        addPoint(data);
      const Scene scene(std::move(data));
      const Measured sppm = meanOverSeeds(scene, settingsOf("sppm", 24), 8, 1);
      const Measured bdpt = meanOverSeeds(scene, settingsOf("bdpt", 192), 8, 1);
      const double noise = kSigmas * std::hypot(sppm.error, bdpt.error) / bdpt.value;
      MESSAGE(std::string(lamp.name), ", roughness ", roughness, ": sppm ", sppm.value, " +- ", sppm.error, ", bdpt ",
              bdpt.value, " +- ", bdpt.error);
      CHECK(std::fabs(sppm.value / bdpt.value - 1) < 0.02 + noise);
      CHECK(noise < 0.15);
    }
}

}  // namespace braid::test_sppm_caustics
