// SPDX-License-Identifier: Apache-2.0
// Photon mapping where it is easily led astray: lights that are hidden, tiny or very many, cameras inside of glass,
// scaled worlds.
#include <cmath>

#include <doctest/doctest.h>

#include "integrators/sppm/sppm_preparation.h"
#include "renderer/core/hash.h"
#include "tests/support/render_fixture.h"

namespace braid::test_sppm_extremes {

using namespace test;

namespace {

Settings sppmSettings(int width, int height, uint64_t spp) {
  Settings s = settingsFor(width, height, spp);
  s.integrators = {"sppm"};
  return s;
}

bool sane(const RenderResult& r) {
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < r.image.size(); ++i)
      if (!std::isfinite(r.image[c][i]) || r.image[c][i] < 0 || !std::isfinite(estimateOf(r).bias[c][i])) return false;
  return r.rejected == 0;
}

// Closed rooms side by side: the camera in the first, and lights in all of them, `share` of the power in the first.
SceneData rooms(int count, float share) {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.6f)), diffuseMaterial(Spectrum(0), Spectrum(share)),
                    diffuseMaterial(Spectrum(0), Spectrum((1 - share) / static_cast<float>(count - 1)))};
  TriangleMesh walls, near, far;
  for (int k = 0; k < count; ++k) {
    const float x = 2.5f * static_cast<float>(k);
    addQuad(walls, {x - 1, -1, 1}, {2, 0, 0}, {0, 0, -2});
    addQuad(walls, {x - 1, 1, 1}, {2, 0, 0}, {0, 0, -2});
    addQuad(walls, {x - 1, -1, -1}, {2, 0, 0}, {0, 2, 0});
    addQuad(walls, {x - 1, -1, 1}, {2, 0, 0}, {0, 2, 0});
    addQuad(walls, {x - 1, -1, 1}, {0, 0, -2}, {0, 2, 0});
    addQuad(walls, {x + 1, -1, 1}, {0, 0, -2}, {0, 2, 0});
    addQuad(k == 0 ? near : far, {x - 0.3f, 0.9f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f});
  }
  addMesh(data, std::move(walls), 0);
  addMesh(data, std::move(near), 1);
  addMesh(data, std::move(far), 2);
  data.cameras.push_back(cameraAt({-0.8f, 0, 0.8f}, {0.5f, -0.6f, -0.8f}));
  return data;
}

double meanVariance(const RenderResult& r) {
  double sum = 0;
  for (const float v : estimateOf(r).variance[1].data) sum += static_cast<double>(v);
  return sum / static_cast<double>(r.image.size());
}

}  // namespace

TEST_CASE("sppm extremes: aiming finds the lights that matter, and changes no mean") {
  const Scene scene(rooms(12, 0.05f));
  Settings aimed = sppmSettings(24, 24, 64);
  aimed.photonRadius = 1;
  Settings byPower = aimed;
  byPower.photonAiming = false;
  const TransportContext context(scene);
  const PhotonPreparation with(context, makePlan(scene, scene.data().cameras[0], aimed, integrators()));
  const PhotonPreparation without(context, makePlan(scene, scene.data().cameras[0], byPower, integrators()));
  CHECK(with.aimed());
  CHECK_FALSE(without.aimed());
  double power = 0;
  for (uint32_t light = 0; light < context.lights.size(); ++light) {
    CHECK(with.emission().probability(light) > 0);
    if (light < 2) power += with.emission().probability(light);
  }
  CHECK(power > 0.25);  // 0.05 by power alone

  const RenderResult a = render(scene, aimed);
  double difference = 0, error2 = 0;
  constexpr int kSeeds = 8;
  for (int seed = 0; seed < kSeeds; ++seed) {
    aimed.seed = static_cast<uint64_t>(seed);
    byPower.seed = static_cast<uint64_t>(seed + 50);
    const double d = meanOf(render(scene, aimed)).value - meanOf(render(scene, byPower)).value;
    difference += d / kSeeds;
    error2 += d * d / kSeeds;
  }
  const double error = std::sqrt(std::max(0.0, error2 - sqr(difference)) / (kSeeds - 1));
  MESSAGE("aimed ", meanVariance(a), ", by power ", meanVariance(render(scene, byPower)), "; means differ by ",
          difference / error, " standard errors");
  CHECK(std::fabs(difference) < 5.4 * error);  // 4 standard deviations' chance by Student's t, 7 degrees of freedom
  CHECK(meanVariance(a) < 0.7 * meanVariance(render(scene, byPower)));
}

TEST_CASE("sppm extremes: aiming is left out where all lights are alike") {
  const Scene scene(cornellBox());
  const TransportContext context(scene);
  const PhotonPreparation p(context, makePlan(scene, scene.data().cameras[0], sppmSettings(24, 24, 1), integrators()));
  CHECK_FALSE(p.aimed());
  CHECK(p.keep() == 1);
}

TEST_CASE("sppm extremes: a hundred thousand emitters") {
  SceneData data = cornellBox();
  data.materials.push_back(diffuseMaterial(Spectrum(0), Spectrum(50)));
  TriangleMesh sparks;
  for (uint32_t i = 0; i < 50000; ++i) {
    const auto u = [&](uint32_t k) { return static_cast<float>(mix32(3 * i + k) >> 8) * 0x1p-24f * 1.8f - 0.9f; };
    addQuad(sparks, {u(0), u(1), u(2)}, {0.002f, 0, 0}, {0, 0, 0.002f});
  }
  addMesh(data, std::move(sparks), 4);
  const Scene scene(std::move(data));
  REQUIRE(scene.emitters().size() > 100000);
  CHECK(sane(render(scene, sppmSettings(16, 16, 4))));
}

TEST_CASE("sppm extremes: one emitter of a square millimetre, many photons at one point") {
  SceneData data = cornellBox();
  data.meshes.pop_back();  // the light
  data.instances.pop_back();
  TriangleMesh spark;
  addQuad(spark, {0, -0.9999f, 0}, {1e-3f, 0, 0}, {0, 0, 1e-3f});
  data.materials[3].emission = Spectrum(1e6f);
  addMesh(data, std::move(spark), 3);
  const Scene scene(std::move(data));
  for (const bool direct : {false, true}) {
    Settings s = sppmSettings(16, 16, 8);
    s.photonDirect = direct;
    s.photons = 20000;
    CHECK(sane(render(scene, s)));
  }
}

TEST_CASE("sppm extremes: the only light in a closed box") {
  SceneData data = rooms(2, 0);
  const Scene scene(std::move(data));
  const RenderResult r = render(scene, sppmSettings(16, 16, 8));
  CHECK(sane(r));
  CHECK(meanOf(r).value == 0);
}

TEST_CASE("sppm extremes: no light at all, and nothing to see") {
  SceneData dark = cornellBox();
  dark.materials[3].emission = Spectrum(0);
  CHECK(meanOf(render(Scene(std::move(dark)), sppmSettings(8, 8, 2))).value == 0);
  SceneData away = cornellBox();
  away.cameras[0].toWorld = glm::translate(Mat4(1), Vec3(0, 0, 50)) * glm::rotate(Mat4(1), 3.14159f, Vec3(0, 1, 0));
  CHECK(meanOf(render(Scene(std::move(away)), sppmSettings(8, 8, 2))).value == 0);
}

TEST_CASE("sppm extremes: a camera inside of glass sees what path tracing sees") {
  SceneData data = cornellBox();
  Material glass = diffuseMaterial(Spectrum(1));
  glass.specular = 1;
  glass.roughness = 0;
  glass.transmission = 1;
  glass.thinWalled = glass.doubleSided = false;
  glass.attenuationColor = {0.5f, 0.9f, 0.7f};
  glass.attenuationDistance = 1;
  data.materials.push_back(glass);
  TriangleMesh ball;
  addSphere(ball, {0, 0, 0.9f}, 0.4f, 4);
  addMesh(data, std::move(ball), 4);
  data.cameras[0] = cameraAt({0, 0, 0.9f}, {0.2f, -0.5f, -1});
  const Scene scene(std::move(data));
  Settings sppm = sppmSettings(16, 16, 128), pt = settingsFor(16, 16, 1024);
  sppm.photonRadius = 1;
  sppm.photons = 8000;
  const RenderResult r = render(scene, sppm), expected = render(scene, pt);
  CHECK(sane(r));
  for (size_t c = 0; c < 3; ++c) CHECK(meanOf(r, c).value == doctest::Approx(meanOf(expected, c).value).epsilon(0.03));
}

TEST_CASE("sppm extremes: scaling the lights scales the image, scaling the world does not change it") {
  const RenderResult plain = render(cornellBox(), sppmSettings(16, 16, 4));
  for (const float scale : {1e-6f, 1e6f}) {
    SceneData data = cornellBox();
    data.materials[3].emission *= scale;
    const RenderResult r = render(std::move(data), sppmSettings(16, 16, 4));
    CHECK(meanOf(r).value == doctest::Approx(meanOf(plain).value * static_cast<double>(scale)).epsilon(1e-4));
  }
  for (const float scale : {1e-3f, 1e4f}) {
    SceneData data = cornellBox();
    for (TriangleMesh& m : data.meshes)
      for (Vec3& p : m.positions) p *= scale;
    data.cameras[0].toWorld[3] = Vec4(scale * Vec3(data.cameras[0].toWorld[3]), 1);
    const RenderResult r = render(std::move(data), sppmSettings(16, 16, 4));
    CHECK(sane(r));
    CHECK(meanOf(r).value == doctest::Approx(meanOf(plain).value).epsilon(0.02));
  }
}

}  // namespace braid::test_sppm_extremes
