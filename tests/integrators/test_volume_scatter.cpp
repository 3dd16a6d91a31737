// SPDX-License-Identifier: Apache-2.0
// Solids that scatter light within: closed forms, furnaces, plain walks, and agreement of all integrators.
#include <cmath>

#include <doctest/doctest.h>

#include "tests/support/media.h"
#include "tests/support/statistics/pass_means.h"
#include "tests/support/statistics/seed_means.h"

namespace braid::test_volume_scatter {

using namespace test;

namespace {

const char* const kAll[] = {"pt", "crn", "gdpt", "bdpt", "vcm", "sppm"};

// Flat faces, so that they are where their normals say.
TriangleMesh ball(float radius = 1, const Vec3& centre = Vec3(0)) {
  TriangleMesh mesh;
  addSphere(mesh, centre, radius, 3);
  mesh.normals.clear();
  return mesh;
}

CameraData before(float halfExtent = 1.1f) { return spotCamera({0, 0, 3}, Vec3(0), halfExtent); }

Settings deep(Settings settings) {
  settings.maxDepth = 500;
  return settings;
}

// A slab 1 m thick, without a boundary to see, under light of radiance 1 from all around.
Measured slabRadiance(const Spectrum& albedo, float g, float freePath, float cosine, uint64_t spp, size_t channel = 1) {
  Material m = scatteringSolid(albedo, freePath, 1);
  m.scatterAnisotropy = g;
  const Vec3 from(std::sqrt(1 - sqr(cosine)), 0, cosine);
  const CameraData camera = spotCamera(Vec3(0, 0, 0.5f) + 2.0f * from, Vec3(0, 0, 0.5f), 0.01f);
  const Scene scene(inWhite(m, boxMesh({-40, -40, -0.5f}, {40, 40, 0.5f}), camera));
  return meanOf(render(scene, settingsFor(16, 16, spp, SamplerKind::Independent)), channel);
}

// A box of coloured walls with wax, rough glass that is filled with something, and a lamp within a mist.
SceneData cabinet(float roughness) {
  SceneData data = cornellBox();
  Material candle = wax({0.98f, 0.9f, 0.6f}, 0.08f), opal = scatteringSolid({0.5f, 0.9f, 0.95f}, 0.3f, 1.4f, roughness),
           mist = scatteringSolid(Spectrum(0.8f), 0.2f, 1);
  candle.attenuationColor = {0.5f, 0.3f, 0.1f};
  opal.attenuationColor = {0.7f, 0.2f, 0.9f};
  opal.scatterAnisotropy = 0.6f;
  mist.scatterAnisotropy = -0.4f;
  addSolid(data, ball(0.3f, {-0.5f, 0.55f, 0.4f}), candle);
  addSolid(data, ball(0.3f, {0.45f, 0, 0.4f}), opal);
  addSolid(data, boxMesh({-0.2f, 0.4f, -0.3f}, {0.3f, 0.8f, 0.1f}), mist);
  Material lamp = diffuseMaterial(Spectrum(0.5f), Spectrum(4, 5, 6));
  lamp.doubleSided = true;
  TriangleMesh panel;
  addQuad(panel, {-0.05f, 0.5f, -0.1f}, {0.2f, 0, 0}, {0, 0.2f, 0});
  addSolid(data, panel, lamp);
  return data;
}

// The largest z over blocks and channels over its limit at 10⁻⁴; `bias`, relative, is forgiven.
double overLimit(const std::vector<Measured>& values, const std::vector<Measured>& expected, double bias) {
  return worst(values, expected, bias) / zLimit(values.size());
}

}  // namespace

TEST_CASE("volume scattering: a medium that absorbs nothing cannot be seen in a white environment, by any integrator") {
  for (const char* name : kAll)
    for (const float freePath : {0.7f, 0.1f}) {
      Material mist = scatteringSolid(Spectrum(1), freePath, 1);
      mist.scatterAnisotropy = 0.4f;
      const Scene scene(inWhite(mist, ball(), before()));
      CAPTURE(std::string(name));
      CAPTURE(freePath);
      for (const Measured& m : passMeans(scene, deep(settingsOf(name, 8, 8, 8)), 4)) {
        CHECK(std::fabs(m.value - 1) < kSigmas * m.error + 1e-4);
        CHECK(m.error < 0.05);
      }
    }
}

// Rough boundaries keep all but 0.5 % of light, which walks that come back from them several times lose as often.
TEST_CASE("volume scattering: within glass, smooth or rough, such a medium cannot be seen either") {
  for (const char* name : kAll)
    for (const float roughness : {0.0f, 0.4f}) {
      const Scene scene(inWhite(scatteringSolid(Spectrum(1), 0.3f, 1.5f, roughness), ball(), before()));
      CAPTURE(std::string(name));
      CAPTURE(roughness);
      for (const Measured& m : passMeans(scene, deep(settingsOf(name, 8, 8, 16)), 8))
        CHECK(std::fabs(m.value - 1) < kSigmas * m.error + (roughness > 0 ? 0.02 : 1e-4));
    }
}

TEST_CASE("volume scattering: without an albedo a solid is that of KHR_materials_volume alone, to the bit") {
  Material plain = scatteringSolid(Spectrum(0), 0.4f, 1.5f, 0.2f), twin = plain;
  plain.attenuationColor = twin.attenuationColor = {0.9f, 0.4f, 0.1f};
  twin.scatterAnisotropy = 0.5f;
  for (const char* name : kAll) {
    const Settings settings = settingsOf(name, 12, 12, 4);
    const RenderResult a = render(inWhite(plain, ball(), before()), settings),
                       b = render(inWhite(twin, ball(), before()), settings);
    CHECK(sameBits(estimateOf(a), estimateOf(b)));
    // Walks that end at their first event leave the same light.
    twin.scatterAlbedo = Spectrum(1e-6f);
    const RenderResult c = render(inWhite(twin, ball(), before()), settings);
    CHECK_FALSE(sameBits(estimateOf(a), estimateOf(c)));
    twin.scatterAlbedo = Spectrum(0);
    CAPTURE(std::string(name));
    CHECK(overLimit(passMeans(Scene(inWhite(twin, ball(), before())), settingsOf(name, 8, 8, 32, 7), 8),
                    passMeans(Scene(inWhite(plain, ball(), before())), settingsOf(name, 8, 8, 32), 8), 0) < 1);
  }
}

TEST_CASE("volume scattering: slabs have the radiance that plain walks through them find") {
  for (const auto& [albedo, g, depth, cosine] :
       {std::array{0.7, 0.0, 2.0, 1.0}, {0.95, 0.6, 5.0, 0.6}, {0.9, -0.5, 1.0, 0.3}, {0.8, 0.9, 20.0, 0.8}}) {
    const Measured expected = plainSlab(albedo, g, depth, cosine);
    const Measured m = slabRadiance(Spectrum(static_cast<float>(albedo)), static_cast<float>(g),
                                    static_cast<float>(1 / depth), static_cast<float>(cosine), 128);
    CAPTURE(albedo);
    CAPTURE(g);
    CAPTURE(m.value / expected.value);
    CHECK(zScore(m, expected) < kSigmas);
    CHECK(m.error < 0.02 * m.value);
  }
}

// A half-space reflects 1 - sqrt(1 - a) H(m) of light from all around.
TEST_CASE("volume scattering: thick slabs of three albedos reflect what Chandrasekhar's H says") {
  const Spectrum albedo(0.5f, 0.8f, 0.97f);
  for (const float cosine : {1.0f, 0.4f})
    for (size_t c = 0; c < 3; ++c) {
      const auto a = static_cast<double>(albedo[static_cast<int>(c)]);
      const double expected = 1 - std::sqrt(1 - a) * chandrasekharH(a, static_cast<double>(cosine));
      const Measured m = slabRadiance(albedo, 0, 1.0f / 60, cosine, 128, c);
      CAPTURE(a);
      CAPTURE(m.value / expected);
      CHECK(std::fabs(m.value - expected) < kSigmas * m.error + 1e-3 * expected);
    }
}

TEST_CASE("volume scattering: all integrators agree on wax, filled glass and a lamp in mist" *
          doctest::test_suite("statistics")) {
  for (const float roughness : {0.0f, 0.5f}) {
    const Scene scene(cabinet(roughness));
    const std::vector<Measured> expected = passMeans(scene, settingsOf("pt", 12, 12, 300, 1), 6);
    for (const char* name : kAll) {
      // Photons and merged vertices blur over a few pixels, which are wide here.
      const bool blurs = std::string(name) == "sppm" || std::string(name) == "vcm";
      Settings settings = settingsOf(name, 12, 12, 100, 2);
      settings.photonRadius = 1;
      CAPTURE(std::string(name));
      CAPTURE(roughness);
      CHECK(overLimit(passMeans(scene, settings, 6), expected, blurs ? 0.03 : 0) < 1);
    }
  }
}

// Lights without size, within a medium: no camera path ends there, and its first surface sees only scattered light.
TEST_CASE("volume scattering: a point light within wax is found by subpaths from it, and told to be missed by pt") {
  SceneData data = cornellBox();
  for (Material& m : data.materials) m.emission = Spectrum(0);
  addSolid(data, ball(0.3f, {0, 0.1f, 0.4f}), wax(Spectrum(0.95f), 0.1f));
  PunctualLight point;
  point.position = {0.05f, 0.1f, 0.4f};
  point.intensity = Spectrum(3);
  data.lights = {point};
  const Scene scene(std::move(data));
  const std::vector<Measured> expected = passMeans(scene, settingsOf("bdpt", 12, 12, 100), 6);
  CHECK(expected[0].value > 10 * expected[0].error);
  Settings settings = settingsOf("sppm", 12, 12, 100);
  settings.photonRadius = 1;
  CHECK(overLimit(passMeans(scene, settings, 6), expected, 0.03) < 1);
  CHECK(overLimit(passMeans(scene, settingsOf("vcm", 12, 12, 100), 6), expected, 0.03) < 1);
  settings.integrators = {"pt"};
  CHECK(!makePlan(scene, scene.data().cameras.at(0), settings, integrators()).unreachable.empty());
  settings.integrators = {"auto"};
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  CHECK(plan.unreachable.empty());
  REQUIRE(plan.integrators.size() == 1);
  CHECK(plan.integrators[0].integrator->name() == std::string("bdpt"));
  CHECK(plan.text().find("+ volume scattering") != std::string::npos);
}

TEST_CASE("volume scattering: the plan names smooth solids that lights without size do not show in") {
  const auto named = [](const Material& material) {
    SceneData data = inWhite(material, ball(), before());
    data.materials[0].name = "soap";
    data.lights.push_back({});
    const Scene scene(std::move(data));
    const Plan plan = makePlan(scene, scene.data().cameras.at(0), settingsOf("pt", 8, 8, 1), integrators());
    return plan.text().find("- lights without size in 'soap'") != std::string::npos;
  };
  CHECK(named(scatteringSolid(Spectrum(0.9f), 0.1f, 1.5f)));
  CHECK_FALSE(named(scatteringSolid(Spectrum(0.9f), 0.1f, 1.5f, 0.3f)));
  CHECK_FALSE(named(scatteringSolid(Spectrum(0), 0.1f, 1.5f)));
  CHECK_FALSE(named(wax(Spectrum(0.9f), 0.1f)));
}

TEST_CASE("volume scattering: guided paths have the same expectation") {
  const Scene scene(cabinet(0.5f));
  Settings guided = settingsOf("pt", 12, 12, 100, 3);
  guided.guiding = Guiding::On;
  CHECK(overLimit(passMeans(scene, guided, 6), passMeans(scene, settingsOf("pt", 12, 12, 200, 4), 6), 0) < 1);
}

TEST_CASE("volume scattering: the number of threads changes no bit") {
  const Scene scene(cabinet(0.3f));
  for (const char* name : kAll) {
    Settings settings = settingsOf(name, 40, 24, 2);
    settings.threads = 1;
    const RenderResult one = render(scene, settings);
    for (const int threads : {2, 5}) {
      settings.threads = threads;
      CAPTURE(std::string(name));
      CHECK(sameBits(estimateOf(one), estimateOf(render(scene, settings))));
    }
  }
}

TEST_CASE("volume scattering: thin air, pitch, sharp lobes and scales of any size end, and are finite") {
  for (const float scale : {1e-6f, 1.0f, 1e6f})
    for (const float freePath : {1e6f, 1e-6f})
      for (const float g : {-0.999f, 0.0f, 0.999f}) {
        Material m = scatteringSolid(Spectrum(1), freePath * scale, 1.3f);
        m.scatterAnisotropy = g;
        const CameraData camera = spotCamera(Vec3(0, 0, 3) * scale, Vec3(0), 1.1f * scale);
        const RenderResult r = render(inWhite(m, ball(scale), camera), settingsFor(8, 8, 4));
        CAPTURE(scale);
        CAPTURE(freePath);
        CAPTURE(g);
        CHECK(r.rejected == 0);
        for (const float v : estimateOf(r).mean[1].data) CHECK(std::isfinite(v));
        // Reflections within may take more than the 32 segments that a path has.
        CHECK(std::fabs(meanOf(r).value - 1) < 5 * meanOf(r).error + 0.05);
      }
}

TEST_CASE("volume scattering: a solid that is not closed fills the bounds of the scene, and paths end") {
  TriangleMesh sheet;
  addQuad(sheet, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
  const RenderResult r = render(inWhite(scatteringSolid(Spectrum(1), 0.01f, 1), sheet, before()), settingsFor(8, 8, 4));
  for (const float v : estimateOf(r).mean[1].data) CHECK(v == doctest::Approx(1).epsilon(1e-4));
}

TEST_CASE("volume scattering: features are those of the first surface, however smooth") {
  for (const char* name : {"pt", "bdpt", "sppm", "gdpt"}) {
    Settings settings = settingsOf(name, 9, 9, 4);
    settings.keep.features = true;
    const RenderResult r = render(
        inWhite(scatteringSolid(Spectrum(0.9f), 0.1f, 1.4f), boxMesh(Vec3(-1), Vec3(1)), before(0.5f)), settings);
    CAPTURE(std::string(name));
    for (const float depth : r.estimates->features->depth.mean.data) CHECK(depth == doctest::Approx(2));
  }
}

}  // namespace braid::test_volume_scatter
