// SPDX-License-Identifier: Apache-2.0
// Dispersion: angles of a prism, a white furnace, and all integrators on one scene.
#include <array>
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "renderer/transport/subpath.h"
#include "tests/support/render_fixture.h"
#include "tests/support/statistics/seed_means.h"

namespace braid::test_dispersion {

using namespace test;

namespace {

constexpr float kApex = 1.0471976f;  // 60 degrees

Material glass(float dispersion, float roughness = 0) {
  Material m;
  m.baseColor = Spectrum(1);
  m.metallic = 0;
  m.roughness = roughness;
  m.transmission = 1;
  m.thinWalled = false;
  m.dispersion = dispersion;
  return m;
}

// Its cross-section is an equilateral triangle of side 1 with the edge on top; it lies along z.
TriangleMesh prism() {
  const float h = std::sqrt(0.75f);
  const Vec3 left(-0.5f, 0, -1), right(0.5f, 0, -1), top(0, h, -1), along(0, 0, 2);
  TriangleMesh mesh;
  addQuad(mesh, left, along, top - left);
  addQuad(mesh, right, top - right, along);
  addQuad(mesh, left, right - left, along);
  for (const float z : {-1.0f, 1.0f}) {
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const Vec3& p : {left, right, top}) mesh.positions.push_back({p.x, p.y, z});
    if (z > 0)
      mesh.triangles.push_back({first, first + 1, first + 2});
    else
      mesh.triangles.push_back({first, first + 2, first + 1});
  }
  return mesh;
}

// Deviation of a ray in the plane of the cross-section that meets the first face at the angle `incidence`, by Snell's
// law at both faces; radians.
double deviation(double index, double incidence) {
  const double inside = std::asin(std::sin(incidence) / index);
  return incidence + std::asin(index * std::sin(static_cast<double>(kApex) - inside)) - static_cast<double>(kApex);
}

SceneData prismScene(float dispersion) {
  SceneData data;
  data.materials = {glass(dispersion)};
  addMesh(data, prism(), 0);
  data.environment = EnvironmentData{nullptr, Spectrum(1), 0};
  data.cameras = {cameraAt({0, 0, 5}, {0, 0, 0})};
  return data;
}

SceneData dispersiveSphere(float roughness) {
  SceneData data;
  data.materials = {glass(5, roughness)};
  TriangleMesh sphere;
  addSphere(sphere, {0, 0, 0}, 1, 4);
  addMesh(data, std::move(sphere), 0);
  data.environment = EnvironmentData{nullptr, Spectrum(1), 0};
  data.cameras = {cameraAt({0, 0, 4}, {0, 0, 0})};
  return data;
}

// A box with a smooth and a rough sphere of dispersive glass, its lamp as large as half of the ceiling.
SceneData glassBox(float dispersion) {
  SceneData data = cornellBox();
  data.materials.push_back(glass(dispersion));
  data.materials.push_back(glass(dispersion, 0.5f));
  const auto smooth = static_cast<uint32_t>(data.materials.size() - 2);
  TriangleMesh one, two;
  addSphere(one, {-0.45f, 0.1f, 0.5f}, 0.35f, 3);
  addSphere(two, {0.45f, 0.2f, 0.4f}, 0.35f, 3);
  addMesh(data, std::move(one), smooth);
  addMesh(data, std::move(two), smooth + 1);
  return data;
}

const SeedMeans kMeans{24, 8, 16, {0, 1, 2}};

}  // namespace

TEST_CASE("dispersion: indices of the channels by the formula of the extension") {
  // n(λ) = A + B/λ², by the index at the line d and the Abbe number alone.
  for (const double abbe : {4.0, 20.0, 59.0}) {
    Material m = glass(static_cast<float>(20 / abbe));
    const double d = 587.6, f = 486.1, c = 656.3;
    const double b = 0.5 / (abbe * (1 / (f * f) - 1 / (c * c))), a = 1.5 - b / (d * d);
    CHECK(static_cast<double>(m.indexOf(0)) == doctest::Approx(a + b / (c * c)).epsilon(5e-5));
    CHECK(m.indexOf(1) == 1.5f);
    CHECK(static_cast<double>(m.indexOf(2)) == doctest::Approx(a + b / (f * f)).epsilon(5e-5));
    CHECK(m.indexOf(3) == 1.5f);
    m.thinWalled = true;
    CHECK(m.indexOf(0) == 1.5f);
  }
  CHECK(glass(1e38f).indexOf(0) == 1);
  CHECK(glass(1e38f).indexOf(2) == kLargestIor);
}

TEST_CASE("dispersion: a prism turns the three channels by the angles of Snell's law, to 0.1 degree") {
  const Scene scene(prismScene(5));
  CHECK(scene.traits().has(kTraitDispersion));
  const TransportContext context(scene);
  const PassSampler sampler(SamplerKind::Independent, 7, 0, 0);
  WalkSettings settings;
  settings.mis = false;
  settings.roulette = {Roulette::kNever, 1};
  SubpathBatch batch(context, sampler, settings);
  // The left face looks to (-cos 30°, sin 30°); the ray comes in 48 degrees below its normal.
  const double incidence = 48 * 3.14159265358979 / 180, normal = 150 * 3.14159265358979 / 180;
  const double from = normal + incidence;
  Camera::CameraRay ray;
  ray.direction = -Vec3(static_cast<float>(std::cos(from)), static_cast<float>(std::sin(from)), 0);
  ray.origin = Vec3(-0.25f, std::sqrt(0.75f) / 2, 0) - 2.0f * ray.direction;
  std::array<int, 3> seen{};
  for (uint64_t first = 0; first < 10; ++first) {
    batch.clear();
    for (uint64_t i = 0; i < kBatch; ++i) batch.startCamera(sampler.itemKey(first * kBatch + i), ray, {}, 1, 1, false);
    batch.run([](int, const SubpathState&, const SubpathVertex&) { return Onward::Scatter; },
              [&](int, const SubpathState& state) {
                if (state.segments != 3) return;  // reflected somewhere
                REQUIRE(state.channel.index < 3);
                CHECK(state.channel.split);
                for (unsigned c = 0; c < 3; ++c)
                  CHECK((state.throughput[static_cast<int>(c)] > 0) == (c == state.channel.index));
                const double index = static_cast<double>(scene.materials()[0].indexOf(state.channel.index));
                const double angle = std::acos(static_cast<double>(glm::dot(ray.direction, state.direction)));
                CHECK(std::fabs(angle - deviation(index, incidence)) < 0.1 * 3.14159265358979 / 180);
                ++seen[state.channel.index];
              });
  }
  for (const int count : seen) CHECK(count > 50);
  // The colours lie degrees apart.
  CHECK(deviation(static_cast<double>(scene.materials()[0].indexOf(2)), incidence) -
            deviation(static_cast<double>(scene.materials()[0].indexOf(0)), incidence) >
        0.1);
}

// False alarm: 6 means within 4 standard errors, 4e-4.
TEST_CASE("dispersion: in a white furnace dispersive glass cannot be seen") {
  for (const float roughness : {0.0f, 0.3f}) {
    const Scene scene(dispersiveSphere(roughness));
    Settings settings = settingsFor(16, 16, 256, SamplerKind::Independent);
    settings.maxDepth = 200;
    const RenderResult r = render(scene, settings);
    for (size_t c = 0; c < 3; ++c) {
      const Measured m = meanOf(r, c);
      MESSAGE("roughness ", roughness, ", channel ", c, ": ", m.value, " +- ", m.error);
      // Single scattering of rough glass loses a little.
      CHECK(m.value < 1 + kSigmas * m.error);
      CHECK(m.value > (roughness > 0 ? 0.985 : 1) - kSigmas * m.error);
    }
  }
}

// A path in one colour, with three times its weight, would leave two channels of three without light.
TEST_CASE("dispersion: camera paths of pt and crn go on in every colour") {
  const Scene scene(dispersiveSphere(0));
  for (const char* integrator : {"pt", "crn"}) {
    Settings settings = settingsFor(16, 16, 1);
    settings.integrators = {integrator};
    settings.maxDepth = 200;
    const RenderResult r = render(scene, settings);
    for (size_t c = 0; c < 3; ++c)
      for (const float value : estimateOf(r).mean[c].data) CHECK(value == doctest::Approx(1).epsilon(1e-3));
  }
}

// False alarm: 12 means within 4 standard errors, 8e-4.
TEST_CASE("dispersion: colours and splits of one path add up to its light") {
  const Scene scene(glassBox(10));
  Settings settings = settingsFor(16, 16, 256, SamplerKind::Independent);
  settings.pathSplits = 1;
  const RenderResult one = render(scene, settings);
  settings.pathSplits = 3;
  settings.seed = 77;
  const RenderResult three = render(scene, settings);
  for (const PixelWindow& block : blocksOf(one, 8))
    for (size_t c = 0; c < 3; ++c) {
      CHECK(std::fabs(zScore(meanOver(one, c, block), meanOver(three, c, block))) < kSigmas);
    }
  settings.spp = 4;
  settings.threads = 1;
  const RenderResult alone = render(scene, settings);
  settings.threads = 5;
  CHECK(sameBits(estimateOf(alone), estimateOf(render(scene, settings))));
}

// Student's t of 15 degrees of freedom and more exceeds 7.5 once in 500,000: over 27 means and 5 integrators a false
// alarm in 3,000 choices of seeds. Photons and merging blur: 3 % are forgiven there.
TEST_CASE("dispersion: all integrators see the same colours through glass") {
  const Scene scene(glassBox(10)), plain(glassBox(0));
  CHECK_FALSE(plain.traits().has(kTraitDispersion));
  const std::vector<Measured> pt = blockMeans(kMeans, scene, "pt", 256, 1000);
  CHECK(worst(blockMeans(kMeans, plain, "pt", 256, 2000), pt, 0) > 7.5);
  const std::tuple<const char*, uint64_t, double> others[] = {
      {"bdpt", 32, 0.0}, {"crn", 64, 0.0}, {"gdpt", 32, 0.0}, {"vcm", 32, 0.03}, {"sppm", 64, 0.03}};
  for (const auto& [name, spp, bias] : others) {
    const double z = worst(blockMeans(kMeans, scene, name, spp, 1), pt, bias);
    MESSAGE(std::string(name), ": largest difference from pt ", z, " standard errors");
    CHECK(z < 7.5);
  }
}

}  // namespace braid::test_dispersion
