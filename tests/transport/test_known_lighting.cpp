// SPDX-License-Identifier: Apache-2.0
// Direct light with a closed form or a quadrature: area, point, spot and directional lights, the environment, glossy
// surfaces, many emitters.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/transport/bsdf/bsdf.h"
#include "tests/support/render_fixture.h"

namespace braid::test_known_lighting {

using namespace test;

namespace {

constexpr double kPiD = 3.14159265358979323846;
const Spectrum kFloorColor(0.8f, 0.5f, 0.2f);

// A floor in the plane y = 0, the camera looks at a spot about `at` from 45 degrees.
SceneData floorScene(const Vec3& at = Vec3(0), const Material& material = diffuseMaterial(kFloorColor)) {
  SceneData data;
  data.materials = {material};
  TriangleMesh floor;
  addQuad(floor, {-50, 0, 50}, {100, 0, 0}, {0, 0, -100});
  addMesh(data, std::move(floor), 0);
  data.cameras = {spotCamera(at + Vec3(0, 1, 1), at, 1e-4f)};
  return data;
}

// Adds an emitter of one side: the parallelogram at p, front by the right-hand rule.
void addLight(SceneData& data, const Vec3& p, const Vec3& a, const Vec3& b, const Spectrum& radiance) {
  Material m = diffuseMaterial(Spectrum(0), radiance);
  m.doubleSided = false;
  data.materials.push_back(m);
  TriangleMesh quad;
  addQuad(quad, p, a, b);
  addMesh(data, std::move(quad), static_cast<uint32_t>(data.materials.size() - 1));
}

// Form factor from a point to a parallel rectangle at height h whose corner lies above the point.
double cornerFormFactor(double a, double b, double h) {
  const double x = a / h, y = b / h, rx = std::sqrt(1 + x * x), ry = std::sqrt(1 + y * y);
  return (x / rx * std::atan(y / rx) + y / ry * std::atan(x / ry)) / (2 * kPiD);
}

// The same for the rectangle [x0, x1] × [z0, z1], by superposition of signed corners.
double formFactor(double x0, double x1, double z0, double z1, double h) {
  return cornerFormFactor(x1, z1, h) - cornerFormFactor(x0, z1, h) - cornerFormFactor(x1, z0, h) +
         cornerFormFactor(x0, z0, h);
}

void checkAllChannels(const RenderResult& result, const glm::dvec3& expected) {
  for (size_t c = 0; c < 3; ++c) {
    const Measured m = meanOf(result, c);
    const double e = expected[static_cast<int>(c)];
    CAPTURE(m.value);
    CAPTURE(m.error);
    CAPTURE(e);
    CHECK(zScore(m, e) < kSigmas);
  }
}

// Radiance of the floor under one light without noise.
void checkPunctual(const PunctualLight& light, const Vec3& at, double irradiance) {
  SceneData data = floorScene(at);
  data.lights = {light};
  const RenderResult result = render(data, settingsFor(4, 4, 4));
  for (size_t c = 0; c < 3; ++c) {
    const int k = static_cast<int>(c);
    const double expected =
        irradiance * static_cast<double>(light.intensity[k]) * static_cast<double>(kFloorColor[k]) / kPiD;
    CHECK(meanOf(result, c).value == doctest::Approx(expected).epsilon(1e-3));
  }
}

PunctualLight lightOfKind(PunctualKind kind) {
  PunctualLight light;
  light.kind = kind;
  light.intensity = Spectrum(5, 3, 1);
  light.position = Vec3(0, 2, 0);
  light.direction = Vec3(0, -1, 0);
  return light;
}

// Irradiance on y = 0 per unit of intensity at distance x from below a light at height 2.
double inverseSquare(double x) {
  const double d2 = x * x + 4;
  return 2 / std::sqrt(d2) / d2;
}

}  // namespace

TEST_CASE("known light: a rectangle parallel to the floor, also off centre") {
  struct Case {
    float x0, x1, z0, z1, h;
  };
  // 6 x 3 x 2 comparisons at 4 standard errors: false-alarm rate 0.002. The last two lie close to a floor triangle of
  // 100 m, from which rays start at a distance that matters there.
  for (const Case& k : {Case{-1, 1, -1, 1, 1}, Case{1, 2, 0.5f, 3, 2}, Case{-0.1f, 0.1f, 4, 4.2f, 0.5f},
                        Case{-5, 30, -20, 2, 0.3f}, Case{-1, 1, -1, 1, 0.15f}, Case{-0.1f, 0.3f, -0.1f, 0.1f, 0.05f}}) {
    for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
      SceneData data = floorScene();
      const Spectrum radiance(3, 2, 1);
      addLight(data, {k.x0, k.h, k.z0}, {k.x1 - k.x0, 0, 0}, {0, 0, k.z1 - k.z0}, radiance);
      // The camera must see the floor past the light.
      data.cameras = {spotCamera(k.h * Vec3(-0.02f, 0.2f, -0.03f), Vec3(0), 1e-5f, {0, 0, 1})};
      const double f = formFactor(k.x0, k.x1, k.z0, k.z1, k.h);
      const RenderResult result = render(data, settingsFor(16, 16, 256, sampler));
      CAPTURE(f);
      CHECK(meanOf(result).error < 0.01 * meanOf(result).value);
      checkAllChannels(result, f * glm::dvec3(radiance) * glm::dvec3(kFloorColor));
    }
  }
}

TEST_CASE("known light: a point light falls off by the inverse square and fades within its range") {
  for (const float x : {0.0f, 1.0f, 3.0f}) {
    PunctualLight light = lightOfKind(PunctualKind::Point);
    checkPunctual(light, {x, 0, 0}, inverseSquare(static_cast<double>(x)));
    light.range = 2.5f;
    const double distance2 = sqr(static_cast<double>(x)) + 4;
    checkPunctual(light, {x, 0, 0},
                  inverseSquare(static_cast<double>(x)) * std::max(0.0, 1 - sqr(distance2 / sqr(2.5))));
  }
}

TEST_CASE("known light: a spot light has the cone of KHR_lights_punctual") {
  PunctualLight light = lightOfKind(PunctualKind::Spot);
  light.innerConeAngle = 0.3f;
  light.outerConeAngle = 0.6f;
  for (const double angle : {0.0, 0.2, 0.29, 0.35, 0.45, 0.55, 0.59, 0.61, 1.0}) {
    const double x = 2 * std::tan(angle);
    const double t = (std::cos(angle) - std::cos(0.6)) / (std::cos(0.3) - std::cos(0.6));
    CAPTURE(angle);
    checkPunctual(light, {static_cast<float>(x), 0, 0}, inverseSquare(x) * sqr(std::clamp(t, 0.0, 1.0)));
  }
}

TEST_CASE("known light: a directional light is the same everywhere") {
  PunctualLight light = lightOfKind(PunctualKind::Directional);
  for (const float tilt : {0.0f, 0.5f, 1.4f, 2.0f}) {
    light.direction = Vec3(std::sin(tilt), -std::cos(tilt), 0);
    const double cosine = std::max(0.0, std::cos(static_cast<double>(tilt)));
    for (const float x : {0.0f, 20.0f}) checkPunctual(light, {x, 0, -x}, cosine);
  }
}

TEST_CASE("known light: lights of all kinds add up") {
  SceneData data = floorScene();
  for (const PunctualKind kind : {PunctualKind::Point, PunctualKind::Spot, PunctualKind::Directional})
    data.lights.push_back(lightOfKind(kind));
  data.environment = EnvironmentData{nullptr, Spectrum(0.5f), 0};
  addLight(data, {1, 1, -1}, {1, 0, 0}, {0, 0, 2}, Spectrum(2));
  const double f = formFactor(1, 2, -1, 1, 1);
  const double punctual = 2 * inverseSquare(0) + 1;
  const glm::dvec3 irradiance = punctual * glm::dvec3(5, 3, 1) + kPiD * (0.5 * (1 - f) + 2 * f);
  checkAllChannels(render(data, settingsFor(32, 32, 256)), irradiance * glm::dvec3(kFloorColor) / kPiD);
}

namespace {

// Radiance of an environment image in a world direction: glTF-style +Y up, centre at -Z, bilinear, turned about +Y.
double environmentAt(const Image& image, double rotation, const glm::dvec3& world) {
  const glm::dvec3 d(std::cos(rotation) * world.x - std::sin(rotation) * world.z, world.y,
                     std::sin(rotation) * world.x + std::cos(rotation) * world.z);
  const double x = (0.5 + std::atan2(d.x, -d.z) / (2 * kPiD)) * image.width - 0.5;
  const double y = std::acos(d.y) / kPiD * image.height - 0.5;
  double sum = 0;
  for (int j = 0; j < image.height; ++j)
    for (int i = 0; i < image.width; ++i) {
      const double value = static_cast<double>(image.floats[static_cast<size_t>(j * image.width + i)]);
      if (value == 0) continue;
      double dx = std::fabs(x - i);
      dx = std::min(dx, image.width - dx);
      sum += value * std::max(0.0, 1 - dx) * std::max(0.0, 1 - std::fabs(std::clamp(y, 0.0, image.height - 1.0) - j));
    }
  return sum;
}

// ∫ L cosθ dω over the upper hemisphere, midpoint rule in (cosθ², φ).
double environmentIrradiance(const Image& image, double rotation) {
  constexpr int kSteps = 1000;
  double sum = 0;
  for (int j = 0; j < kSteps; ++j)
    for (int i = 0; i < kSteps; ++i) {
      const double y = std::sqrt((j + 0.5) / kSteps), r = std::sqrt(1 - y * y), phi = 2 * kPiD * (i + 0.5) / kSteps;
      sum += environmentAt(image, rotation, {r * std::cos(phi), y, r * std::sin(phi)});
    }
  return kPiD * sum / (kSteps * kSteps);
}

}  // namespace

TEST_CASE("known light: an environment image with one bright texel") {
  for (const auto& [x, y, rotation] : {std::tuple(3, 1, 0.0), std::tuple(0, 2, 1.0), std::tuple(11, 3, -2.5)}) {
    auto image = std::make_shared<Image>();
    image->width = 16;
    image->height = 8;
    image->channels = 1;
    image->floats.assign(128, 0.0f);
    image->floats[static_cast<size_t>(y * 16 + x)] = 10;
    const double irradiance = environmentIrradiance(*image, rotation);
    SceneData data = floorScene();
    data.environment = EnvironmentData{image, Spectrum(1, 2, 0.5f), static_cast<float>(rotation)};
    CAPTURE(x);
    const RenderResult result = render(data, settingsFor(32, 32, 128));
    CHECK(meanOf(result).error < 0.005 * meanOf(result).value);
    checkAllChannels(result, irradiance * glm::dvec3(1, 2, 0.5) * glm::dvec3(kFloorColor) / kPiD);
  }
}

TEST_CASE("known light: a constant environment lights a floor evenly, a background is seen by the camera only") {
  SceneData data = floorScene();
  data.environment = EnvironmentData{nullptr, Spectrum(0.3f, 0.6f, 0.9f), 0};
  const RenderResult lit = render(data, settingsFor(16, 16, 64));
  checkAllChannels(lit, glm::dvec3(0.3f, 0.6f, 0.9f) * glm::dvec3(kFloorColor));
  Settings settings = settingsFor(16, 16, 64);
  settings.background = Spectrum(9);
  CHECK(sameBits(estimateOf(render(data, settings)), estimateOf(lit)));
  data.cameras = {cameraAt({0, 1, 0}, {0, 2, 0}, {0, 0, 1})};
  checkAllChannels(render(data, settings), glm::dvec3(9));
  checkAllChannels(render(data, settingsFor(4, 4, 1)), glm::dvec3(0.3f, 0.6f, 0.9f));
}

TEST_CASE("known light: a glossy floor under small and large lights, where either strategy alone would fail") {
  // 5 x 2 x 3 comparisons at 4 standard errors: false-alarm rate 0.002. Quadrature of f · cos · L over the light.
  for (const float roughness : {0.1f, 0.2f, 0.4f, 0.7f, 1.0f})
    for (const float half : {0.1f, 1.5f}) {
      Material m = diffuseMaterial(kFloorColor);
      m.metallic = 0.5f;
      m.specular = 1;
      m.roughness = roughness;
      SceneData data = floorScene(Vec3(0), m);
      const Vec3 centre(0, 1.5f, -1.5f);
      addLight(data, centre + Vec3(-half, 0, -half), {2 * half, 0, 0}, {0, 0, 2 * half}, Spectrum(1));
      SurfaceParameters p;
      p.lobes = kLobeDiffuse | kLobeSpecular | kLobeMultiScatter;
      p.baseColor = m.baseColor;
      p.metallic = m.metallic;
      p.roughness = roughness;
      const auto local = [](const Vec3& v) { return glm::normalize(Vec3(v.x, -v.z, v.y)); };
      const Bsdf bsdf(p, local({0, 1, 1}));
      constexpr int kSteps = 600;
      glm::dvec3 expected(0);
      for (int i = 0; i < kSteps * kSteps; ++i) {
        const Vec2 u((static_cast<float>(i / kSteps) + 0.5f) / kSteps,
                     (static_cast<float>(i % kSteps) + 0.5f) / kSteps);
        const Vec3 point = centre + Vec3((2 * u.x - 1) * half, 0, (2 * u.y - 1) * half);
        const double d2 = static_cast<double>(glm::dot(point, point)), cosine = 1.5 / std::sqrt(d2);
        expected += glm::dvec3(bsdf.evaluate(local(point)).f) * (cosine / d2);
      }
      expected *= 4.0 * static_cast<double>(sqr(half)) / (kSteps * kSteps);
      CAPTURE(roughness);
      CAPTURE(half);
      const RenderResult result = render(data, settingsFor(16, 16, 256));
      CHECK(meanOf(result).error < 0.01 * meanOf(result).value);
      checkAllChannels(result, expected);
    }
}

TEST_CASE("known light: many emitters by power and by hierarchy give the same image, seen and unseen") {
  SceneData data = floorScene();
  data.cameras = {cameraAt({0, 3, 6}, {0, 1, 0})};
  Rng rng(3);
  for (int i = 0; i < 120; ++i) {
    const Vec3 p(8 * rng.next() - 4, 0.3f + 2 * rng.next(), 8 * rng.next() - 4);
    const Vec3 a = squareToUniformSphere(rng.next2()), b = squareToUniformSphere(rng.next2());
    addLight(data, p, (0.05f + 0.3f * rng.next()) * a, 0.2f * b, Spectrum(rng.next(), rng.next(), 1) * 20.0f);
    data.materials.back().doubleSided = i % 2 == 0;
    data.materials.back().baseColor = Spectrum(0.5f);
  }
  for (int i = 0; i < 5; ++i) {
    PunctualLight light = lightOfKind(i % 2 ? PunctualKind::Point : PunctualKind::Spot);
    light.position = Vec3(2 * i - 4, 1 + 0.3f * static_cast<float>(i), 1);
    data.lights.push_back(light);
  }
  const Scene scene(data);
  Settings settings = settingsFor(32, 24, 256);
  settings.maxDepth = 4;
  settings.lightStrategy = LightStrategy::Power;
  const RenderResult power = render(scene, settings);
  settings.lightStrategy = LightStrategy::Hierarchy;
  settings.seed = 1;
  const RenderResult hierarchy = render(scene, settings);
  CHECK(disagreement(power, hierarchy) < 1);
  CHECK(zScore(meanOf(power), meanOf(hierarchy)) < kSigmas);
  MESSAGE("mean ", meanOf(power).value, " +- ", meanOf(power).error, " by power, ", meanOf(hierarchy).value, " +- ",
          meanOf(hierarchy).error, " by hierarchy");
}

}  // namespace braid::test_known_lighting
