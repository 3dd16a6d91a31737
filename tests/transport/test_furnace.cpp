// SPDX-License-Identifier: Apache-2.0
// Furnaces: scenes where every point sees the same radiance, so that the answer is known whatever the shape.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/transport/bsdf/bsdf.h"
#include "tests/support/render_fixture.h"

namespace braid::test_furnace {

using namespace test;

namespace {

constexpr SamplerKind kSamplers[] = {SamplerKind::Independent, SamplerKind::Sobol};

Measured furnaceMean(float albedo, int maxDepth, SamplerKind sampler, uint64_t spp = 64) {
  Settings settings = settingsFor(20, 20, spp, sampler);
  settings.maxDepth = maxDepth;
  return meanOf(render(furnace(albedo, 0.5f), settings));
}

SceneData whiteSurroundings(const Material& material, TriangleMesh mesh, const CameraData& camera) {
  SceneData data;
  data.materials = {material};
  addMesh(data, std::move(mesh), 0);
  data.environment = EnvironmentData{nullptr, Spectrum(1), 0};
  data.cameras = {camera};
  return data;
}

Material opaque(const Spectrum& color, float roughness, float metallic) {
  Material m;
  m.baseColor = color;
  m.roughness = roughness;
  m.metallic = metallic;
  m.doubleSided = true;
  return m;
}

Material solidGlass(float roughness) {
  Material m = opaque(Spectrum(1), roughness, 0);
  m.doubleSided = false;
  m.transmission = 1;
  m.thinWalled = false;
  return m;
}

// What the renderer must make of an untextured opaque material.
SurfaceParameters parametersOf(const Material& m) {
  SurfaceParameters p;
  p.lobes = kLobeDiffuse | kLobeSpecular;
  p.baseColor = m.baseColor;
  p.metallic = m.metallic;
  p.roughness = m.roughness;
  if (m.multiScatter && m.losesToRoughness()) p.lobes |= kLobeMultiScatter;
  if (m.clearcoat > 0) p.lobes |= kLobeClearcoat;
  p.clearcoat = m.clearcoat;
  p.clearcoatRoughness = m.clearcoatRoughness;
  if (maxComponent(m.sheenColor) > 0) p.lobes |= kLobeSheen;
  p.sheenColor = m.sheenColor;
  p.sheenRoughness = m.sheenRoughness;
  return p;
}

// Directional albedo: quadrature of evaluate() over the sphere, and the mirrors, which it leaves out, by their weights.
Spectrum directionalAlbedo(const SurfaceParameters& p, const Vec3& wo) {
  const Bsdf bsdf(p, wo);
  std::vector<Vec3> pilot;
  Rng rng(1);
  glm::dvec3 mirrors(0);
  constexpr int kPilots = 8192;
  for (int i = 0; i < kPilots; ++i) {
    BsdfSample s;
    if (!bsdf.sample((static_cast<float>(i) + 0.5f) / kPilots, rng.next2(), s)) continue;
    if (s.delta) mirrors += glm::dvec3(s.weight) / double(kPilots);
    if (!s.delta) pilot.push_back(s.wi);
  }
  Spectrum albedo(mirrors);
  if (pilot.empty()) return albedo;
  const SphereCells cells(pilot, 200);
  for (int c = 0; c < 3; ++c) {
    double sum = 0;
    for (const double v : cells.integrate([&](const Vec3& wi) { return bsdf.evaluate(wi).f[c]; }, 2e-4)) sum += v;
    albedo[c] += static_cast<float>(sum);
  }
  return albedo;
}

// The largest distance in standard errors between the radiance of a flat surface seen at a fixed angle and the albedo.
// Quadrature is good to 5e-4.
double flatSurfaceScore(const Material& material, float cosine) {
  TriangleMesh quad;
  addQuad(quad, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
  const Vec3 wo(std::sqrt(1 - sqr(cosine)), 0, cosine);
  const CameraData camera = spotCamera(wo, Vec3(0), 0.05f);
  const RenderResult result = render(whiteSurroundings(material, quad, camera), settingsFor(12, 12, 64));
  const Spectrum albedo = directionalAlbedo(parametersOf(material), wo);
  double worst = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double expected = static_cast<double>(albedo[static_cast<int>(c)]);
    const Measured m = meanOf(result, c);
    CAPTURE(m.value);
    CAPTURE(expected);
    CHECK(m.value < 1 + kSigmas * m.error + 1e-4);
    const double beyond = std::max(0.0, std::fabs(m.value - expected) - 5e-4);
    worst = std::max(worst, beyond / std::max(m.error, 1e-9));
  }
  return worst;
}

TriangleMesh unitSphere(bool smooth) {
  TriangleMesh sphere;
  addSphere(sphere, Vec3(0), 1, 4);
  if (!smooth) sphere.normals.clear();
  return sphere;
}

RenderResult renderSphere(const Material& material, bool smooth, uint64_t spp) {
  Settings settings = settingsFor(24, 24, spp);
  settings.maxDepth = 500;
  return render(whiteSurroundings(material, unitSphere(smooth), spotCamera({0, 0, 3}, Vec3(0), 1.1f)), settings);
}

// How far the brightest 4 x 4 pixels rise above 1, over what noise explains.
double excess(const RenderResult& result) {
  const std::vector<PixelWindow> blocks = blocksOf(result, 4);
  double worst = 0;
  for (const PixelWindow& w : blocks)
    for (size_t c = 0; c < 3; ++c) {
      const Measured m = meanOver(result, c, w);
      worst = std::max(worst, (m.value - 1 - 1e-4) / std::max(m.error, 1e-9));
    }
  return worst / zLimit(3 * blocks.size());
}

}  // namespace

TEST_CASE("furnace: the closed furnace has radiance e / (1 - a)") {
  for (const SamplerKind sampler : kSamplers)
    for (const float a : {0.0f, 0.2f, 0.5f, 0.8f, 0.95f}) {
      const Measured m = furnaceMean(a, 2000, sampler);
      const double expected = 0.5 / (1 - static_cast<double>(a));
      MESSAGE("albedo ", a, ": ", m.value / expected, " +- ", m.error / expected, " of the exact value");
      CHECK(zScore(m, expected) < kSigmas);
      CHECK(m.error < 0.01 * expected);
    }
}

TEST_CASE("furnace: n segments of the closed furnace have radiance e (1 - a^n) / (1 - a)") {
  for (const SamplerKind sampler : kSamplers)
    for (const double a : {0.5, 0.8})
      for (const int n : {1, 2, 3, 4, 5, 8, 20}) {
        const Measured m = furnaceMean(static_cast<float>(a), n, sampler);
        const double expected = 0.5 * (1 - std::pow(a, n)) / (1 - a);
        CAPTURE(a);
        CAPTURE(n);
        CAPTURE(m.value / expected);
        CHECK(zScore(m, expected) < kSigmas);
        if (n == 1) CHECK(m.error == 0);
      }
}

TEST_CASE("furnace: an opaque surface in a white environment shows its directional albedo") {
  // 88 scores of 3 channels.
  const double limit = zLimit(264);
  for (const float roughness : {0.0f, 0.05f, 0.3f, 0.6f, 1.0f})
    for (const float metallic : {0.0f, 0.5f, 1.0f})
      for (const float cosine : {0.9f, 0.3f})
        for (const Spectrum& color : {Spectrum(1), Spectrum(0.7f, 0.3f, 0.05f)}) {
          CAPTURE(roughness);
          CAPTURE(metallic);
          CAPTURE(cosine);
          CHECK(flatSurfaceScore(opaque(color, roughness, metallic), cosine) < limit);
        }
  for (const float roughness : {0.0f, 0.05f, 0.3f, 0.6f, 1.0f})
    for (const float cosine : {0.9f, 0.3f}) {
      CAPTURE(roughness);
      CAPTURE(cosine);
      Material coated = opaque(Spectrum(0.9f, 0.5f, 0.1f), 0.5f, 0.5f);
      coated.clearcoat = 1;
      coated.clearcoatRoughness = roughness;
      CHECK(flatSurfaceScore(coated, cosine) < limit);
      if (roughness == 0) continue;
      Material cloth = opaque(Spectrum(0.9f, 0.5f, 0.1f), 0.8f, 0);
      cloth.sheenColor = Spectrum(1, 0.6f, 0.2f);
      cloth.sheenRoughness = roughness;
      CHECK(flatSurfaceScore(cloth, cosine) < limit);
    }
}

TEST_CASE("furnace: no white sphere is brighter than its white environment") {
  const auto check = [](const Material& m, bool smooth) {
    const RenderResult result = renderSphere(m, smooth, 32);
    CHECK(excess(result) < 1);
    CHECK(result.rejected == 0);
    CHECK(meanOf(result).value > 0.4);
  };
  for (const float roughness : {0.0f, 0.05f, 0.3f, 0.6f, 1.0f}) {
    CAPTURE(roughness);
    for (const float metallic : {0.0f, 0.5f, 1.0f}) check(opaque(Spectrum(1), roughness, metallic), true);
    check(solidGlass(roughness), true);
    check(solidGlass(roughness), false);
    Material layered = opaque(Spectrum(1), roughness, 0);
    layered.clearcoat = 1;
    layered.clearcoatRoughness = 0.2f;
    layered.sheenColor = Spectrum(1);
    layered.sheenRoughness = 0.5f;
    check(layered, true);
    Material thin = solidGlass(roughness);
    thin.thinWalled = true;
    check(thin, true);
  }
}

TEST_CASE("furnace: clear glass in a white environment cannot be seen") {
  // Flat faces, few enough that total reflection holds no path for more than 500 segments.
  TriangleMesh ball;
  addSphere(ball, Vec3(0), 1, 2);
  ball.normals.clear();
  for (const float ior : {1.0f, 1.5f, 2.4f}) {
    Material m = solidGlass(0);
    m.ior = ior;
    Settings settings = settingsFor(24, 24, 64);
    settings.maxDepth = 500;
    const RenderResult result = render(whiteSurroundings(m, ball, spotCamera({0, 0, 3}, Vec3(0), 1.1f)), settings);
    CAPTURE(ior);
    for (const float v : estimateOf(result).mean[1].data) CHECK(v == doctest::Approx(1).epsilon(1e-5));
  }
}

}  // namespace braid::test_furnace
