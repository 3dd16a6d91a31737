// SPDX-License-Identifier: Apache-2.0
// Photon mapping finds all light once: it agrees with path tracing, with itself under its options, and with closed
// forms. Its bias has limits of its own below, which also cover what the kernel loses at the rims of surfaces.
#include <cmath>

#include <doctest/doctest.h>

#include "integrators/sppm/sppm_gather.h"
#include "integrators/sppm/sppm_preparation.h"
#include "tests/support/render_fixture.h"

namespace braid::test_sppm {

using namespace test;

namespace {

Settings sppmSettings(int width, int height, uint64_t spp) {
  Settings s = settingsFor(width, height, spp);
  s.integrators = {"sppm"};
  return s;
}

// Relative difference of two images' means and how far it may go by chance: 4 standard errors.
struct Difference {
  double relative, noise;
};

Difference compare(const Scene& scene, const Settings& a, const Settings& b) {
  const Measured first = meanOverSeeds(scene, a, 5, 0), second = meanOverSeeds(scene, b, 5, 100);
  return {first.value / second.value - 1, kSigmas * std::hypot(first.error, second.error) / second.value};
}

void checkAgree(const std::string& what, const Scene& scene, const Settings& a, const Settings& b, double bias) {
  const Difference d = compare(scene, a, b);
  MESSAGE(what, ": ", 100 * d.relative, " % apart, noise allows ", 100 * d.noise, " %, bias ", 100 * bias, " %");
  CHECK(std::fabs(d.relative) < bias + d.noise);
  CHECK(d.noise < 0.03);
}

Material glossy(const Spectrum& color, float roughness, float metallic) {
  Material m = diffuseMaterial(color);
  m.specular = 1;
  m.roughness = roughness;
  m.metallic = metallic;
  return m;
}

Material glassMaterial() {
  Material m = glossy(Spectrum(1), 0, 0);
  m.transmission = 1;
  m.thinWalled = false;
  m.doubleSided = false;
  return m;
}

// A room whose floor, walls and furniture have all kinds of lobes: broad and narrow in one material, broad metal,
// narrow metal, a mirror's coat, and glass. The light is large, so that a path tracer finds its caustics, too.
SceneData lobeRoom() {
  SceneData data = cornellBox();
  data.materials[0] = glossy(Spectrum(0.7f), 0.4f, 0);
  data.materials[1] = glossy({0.8f, 0.4f, 0.3f}, 0.7f, 1);
  data.materials[2] = glossy({0.3f, 0.8f, 0.4f}, 0.35f, 1);
  Material coated = diffuseMaterial(Spectrum(0.5f));
  coated.clearcoat = 1;
  coated.clearcoatRoughness = 0;
  data.materials.push_back(coated);
  data.materials.push_back(glassMaterial());
  data.meshes[1].material = 4;  // the blocks
  TriangleMesh ball;
  addSphere(ball, {0.5f, 0.1f, 0.5f}, 0.3f, 3);
  addMesh(data, std::move(ball), 5);
  data.materials[3].emission = Spectrum(0);
  data.materials.push_back(diffuseMaterial(Spectrum(0.2f), Spectrum(1.5f)));
  data.materials.back().doubleSided = false;  // or photons would crowd between it and the ceiling
  TriangleMesh light;
  addQuad(light, {-0.8f, 0.97f, -0.8f}, {1.6f, 0, 0}, {0, 0, 1.6f});
  addMesh(data, std::move(light), 6);
  return data;
}

// Scenes with one kind of light each over a floor, a wall and a ball.
SceneData stage() {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.6f)), glossy({0.7f, 0.5f, 0.3f}, 0.2f, 0)};
  TriangleMesh floor, ball;
  addQuad(floor, {-3, 0, 3}, {6, 0, 0}, {0, 0, -6});
  addQuad(floor, {-3, 0, -3}, {6, 0, 0}, {0, 4, 0});
  addSphere(ball, {0, 0.7f, 0}, 0.7f, 3);
  addMesh(data, std::move(floor), 0);
  addMesh(data, std::move(ball), 1);
  data.cameras.push_back(cameraAt({0.5f, 2, 6}, {0, 0.8f, 0}));
  return data;
}

PunctualLight punctual(PunctualKind kind, float intensity) {
  PunctualLight light;
  light.kind = kind;
  light.position = {1, 3, 2};
  light.direction = glm::normalize(Vec3(-0.4f, -1, -0.6f));
  light.intensity = Spectrum(intensity);
  light.innerConeAngle = 0.3f;
  light.outerConeAngle = 0.6f;
  return light;
}

}  // namespace

TEST_CASE("sppm: a closed furnace has the radiance 1 / (1 - albedo)") {
  for (const float albedo : {0.0f, 0.5f, 0.8f})
    for (const bool direct : {false, true}) {
      Settings s = sppmSettings(16, 16, 32);
      s.photonDirect = direct;
      s.maxDepth = 200;
      s.photons = 4096;
      const RenderResult r = render(furnace(albedo, 1), s);
      const double expected = 1 / (1 - static_cast<double>(albedo)), mean = meanOf(r).value;
      MESSAGE("albedo ", albedo, std::string(direct ? ", photons alone: " : ": "), mean, " of ", expected);
      CHECK(std::fabs(mean - expected) < 0.015 * expected);
    }
}

TEST_CASE("sppm: every light path is counted once, whatever lobes it meets and however long it is") {
  const Scene scene(lobeRoom());
  for (const int depth : {2, 3, 16}) {
    Settings pt = settingsFor(24, 24, 64), sppm = sppmSettings(24, 24, 32);
    pt.maxDepth = sppm.maxDepth = depth;
    sppm.photons = 4000;
    sppm.photonRadius = 0.5f;
    checkAgree("paths of " + std::to_string(depth) + " segments, pt", scene, sppm, pt, 0.005);
    Settings direct = sppm;
    direct.photonDirect = true;
    checkAgree("paths of " + std::to_string(depth) + " segments, direct light by photons", scene, direct, sppm, 0.01);
  }
}

TEST_CASE("sppm: all kinds of lights") {
  struct Case {
    const char* name;
    std::function<void(SceneData&)> addTo;
  };
  const Case cases[] = {
      {"point", [](SceneData& d) { d.lights = {punctual(PunctualKind::Point, 30)}; }},
      {"spot", [](SceneData& d) { d.lights = {punctual(PunctualKind::Spot, 60)}; }},
      {"directional", [](SceneData& d) { d.lights = {punctual(PunctualKind::Directional, 3)}; }},
      {"environment", [](SceneData& d) { d.environment.emplace().radiance = Spectrum(0.5f, 0.7f, 1); }},
  };
  for (const Case& c : cases) {
    SceneData data = stage();
    c.addTo(data);
    const Scene scene(std::move(data));
    Settings sppm = sppmSettings(24, 18, 32);
    sppm.photons = 4000;
    sppm.photonRadius = 0.5f;
    checkAgree(std::string(c.name) + ", pt", scene, sppm, settingsFor(24, 18, 64), 0.005);
    Settings direct = sppm;
    direct.photonDirect = true;
    checkAgree(std::string(c.name) + ", direct light by photons", scene, direct, sppm, 0.01);
  }
}

TEST_CASE("sppm: radii depend on the pass alone, alike for four passes, and fall with the power -1/6") {
  for (uint64_t pass = 0; pass < 64; ++pass) CHECK(radiusShrinkage(pass) == radiusShrinkage(pass / 4 * 4));
  CHECK(radiusShrinkage(3) == 1);
  CHECK(radiusShrinkage(4 * 63) == doctest::Approx(0.5));
  CHECK(radiusShrinkage(4 * 728) == doctest::Approx(1.0 / 3));
}

namespace {

// Light paths on a lattice, turned against the axes, that bring the irradiance E(x, y) W/m² to a diffuse white plane
// about the origin; and what is gathered at a point of it.
template <class Irradiance>
GatheredLight gatherLattice(const Irradiance& irradiance, float radius, const Vec3& position) {
  constexpr int kSide = 900;
  constexpr float kCell = 2.0f / kSide;
  std::vector<Photon> photons;
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) {
      const float u = (static_cast<float>(i) + 0.5f) * kCell - 1, v = (static_cast<float>(j) + 0.5f) * kCell - 1;
      Photon p;
      p.position = Vec3(0.8f * u - 0.6f * v, 0.6f * u + 0.8f * v, 0);
      p.power = Spectrum(irradiance(p.position) * sqr(kCell));
      p.direction = packDirection({0, 0, 1}, 16);
      p.normal = static_cast<uint16_t>(packDirection({0, 0, 1}, 8));
      p.segments = 1;
      photons.push_back(p);
    }
  RadiusScale scale;
  scale.perspective = false;
  scale.perMetre = scale.largest = radius;
  scale.smallest = 1e-3f;
  SubpathVertex vertex(Spectrum(1), Vec3(0, 0, 1));
  vertex.hit.position = position;
  vertex.hit.ng = Vec3(0, 0, 1);
  vertex.hit.frame = Frame();
  return gatheredLight(gatherPhotons(PhotonGrid(photons, scale), vertex, radius, 5), 1, radius);
}

// How much of a disc of radius 1 lies beyond a line at this distance from its centre.
double beyond(double distance) {
  const double d = std::clamp(distance, -1.0, 1.0);
  return (std::acos(d) - d * std::sqrt(1 - d * d)) / static_cast<double>(kPi);
}

}  // namespace

TEST_CASE("sppm: the bias estimate is true for a quadratic irradiance") {
  // E(x) = 1 + 3 x² W/m²: the kernel's bias is R²/8 · ΔE = 3 R²/4.
  const GatheredLight light = gatherLattice([](const Vec3& p) { return 1 + 3 * sqr(p.x); }, 0.4f, Vec3(0.1f, 0, 0));
  CHECK(kPi * light.radiance.x == doctest::Approx(1.03 + 0.75 * 0.16).epsilon(2e-3));
  CHECK(kPi * light.bias.x == doctest::Approx(0.75 * 0.16).epsilon(0.03));
}

TEST_CASE("sppm: at an edge of light the bias estimate tells 0.41 of the mean squared bias and leaves 0.44") {
  constexpr float kRadius = 0.4f;
  const double inner = std::sqrt(static_cast<double>(kInnerArea));
  double told = 0, left = 0, truth = 0;
  for (const double d : {-0.9, -0.7, -0.5, -0.3, -0.1, 0.1, 0.3, 0.5, 0.7, 0.9}) {
    const Vec3 at(static_cast<float>(d) * kRadius, 0, 0);
    const GatheredLight light = gatherLattice([](const Vec3& p) { return p.x > 0 ? 1.0f : 0.0f; }, kRadius, at);
    const double lit = d > 0, bias = beyond(-d) - lit;
    CAPTURE(d);
    CHECK(kPi * light.radiance.x == doctest::Approx(lit + bias).epsilon(0.01));
    const double expected = (beyond(-d) - beyond(-d / inner)) / (1 - sqr(inner));
    CHECK(std::abs(static_cast<double>(kPi * light.bias.x) - expected) < 0.01);
    told += sqr(static_cast<double>(kPi * light.bias.x));
    left += sqr(bias - static_cast<double>(kPi * light.bias.x));
    truth += sqr(bias);
  }
  CHECK(told / truth == doctest::Approx(0.41).epsilon(0.1));
  CHECK(left / truth == doctest::Approx(0.44).epsilon(0.1));
}

TEST_CASE("sppm: what a pass stores is bounded, and thinning does not change the mean") {
  SceneData data = furnace(0.97f, 1);
  const Scene scene(std::move(data));
  Settings s = sppmSettings(24, 24, 32);
  s.maxDepth = 400;
  s.photons = 4096;
  s.photonDirect = true;
  const Plan plan = makePlan(scene, scene.data().cameras[0], s, integrators());
  const TransportContext context(scene);
  const PhotonPreparation preparation(context, plan);
  CHECK(preparation.keep() < 0.3f);
  const PassSampler sampler(SamplerKind::Independent, 0, 1, 0);
  TracedPhotons traced;
  REQUIRE(tracePhotons(context, {preparation.emission(), sampler, s.photons}, s, preparation.keep(), nullptr, traced));
  CHECK(static_cast<double>(traced.photons.size()) < kStoredPerPath * static_cast<double>(s.photons));
  CHECK(static_cast<double>(traced.photons.size()) > 0.7 * kStoredPerPath * static_cast<double>(s.photons));
  CHECK(meanOf(render(scene, s)).value == doctest::Approx(1 / 0.03).epsilon(0.03));
  CHECK(plan.text().find("sppm memory: at most ") != std::string::npos);
}

}  // namespace braid::test_sppm
