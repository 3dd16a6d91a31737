// SPDX-License-Identifier: Apache-2.0
// Light sampling: points on emitters and their densities, and the irradiance that all lights add up to.
#include <doctest/doctest.h>

#include "renderer/scene/scene.h"
#include "renderer/transport/lights/light_sampler.h"
#include "tests/support/counts.h"
#include "tools/bench/builtin_scenes.h"

namespace braid::test_lights {

using test::Rng;

namespace {

// All tests of a case together raise a false alarm with this probability; the seeds are fixed.
constexpr double kFalseAlarm = 1e-3;

Vec3 randomPoint(Rng& rng) { return Vec3(rng.next(), rng.next(), rng.next()) * 2.0f - 1.0f; }
Vec3 randomDirection(Rng& rng) { return squareToUniformSphere(rng.next2()); }

// Triangles with random places, sizes and powers, each a mesh of its own; about half are two-sided.
SceneData randomEmitters(Rng& rng, int count, float spread, float size) {
  SceneData data;
  for (int i = 0; i < count; ++i) {
    TriangleMesh mesh;
    const Vec3 centre = spread * randomPoint(rng);
    for (int k = 0; k < 3; ++k) mesh.positions.push_back(centre + size * randomPoint(rng));
    mesh.triangles = {{0, 1, 2}};
    data.materials.push_back(diffuseMaterial(Spectrum(0), Spectrum(std::exp(6 * rng.next() - 3))));
    data.materials.back().doubleSided = rng.next() < 0.5f;
    addMesh(data, std::move(mesh), static_cast<uint32_t>(i));
  }
  return data;
}

// Distance along a ray to an emitter that shines on its origin; infinity if it does not.
float distanceTo(const EmissiveTriangle& e, const Vec3& origin, const Vec3& direction) {
  const glm::dvec3 o(origin - e.p0), d(direction), a(e.e1), b(e.e2), p = glm::cross(d, b);
  const double det = glm::dot(a, p);
  if (det == 0 || (!e.twoSided && glm::dot(direction, e.normal) >= 0)) return kInfinity;
  const double u = glm::dot(o, p) / det, v = glm::dot(d, glm::cross(o, a)) / det;
  const double t = glm::dot(b, glm::cross(o, a)) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && t > 0 ? static_cast<float>(t) : kInfinity;
}

constexpr size_t kStrips = 4;  // a triangle is cut into this squared cells of equal area

// The cell of a point of an emitter, by its barycentric coordinates.
size_t cellOf(const EmissiveTriangle& e, const Vec3& point) {
  const glm::dvec3 d(point - e.p0), a(e.e1), b(e.e2);
  const double aa = glm::dot(a, a), ab = glm::dot(a, b), bb = glm::dot(b, b), da = glm::dot(d, a), db = glm::dot(d, b);
  const double det = aa * bb - ab * ab, u = (da * bb - db * ab) / det, v = (db * aa - da * ab) / det;
  // u = 1 - √x, v = y √x maps the unit square to the triangle with constant density.
  const double x = sqr(1 - u), y = u < 1 ? v / (1 - u) : 0;
  const auto strip = [](double t) { return std::clamp<size_t>(static_cast<size_t>(t * kStrips), 0, kStrips - 1); };
  return strip(x) * kStrips + strip(y);
}

// Chi-squared test of sample() against pdfEmitter(), over cells of the emitters' surfaces. The expected count of a cell
// is ∫ pdf cos / distance² over its area, by a midpoint rule whose integrand the sampler claims to be constant.
double emittersPValue(const Scene& scene, const LightSampler& lights, const Vec3& p, const Vec3& n, bool twoSided,
                      Rng& rng) {
  const std::vector<EmissiveTriangle>& emitters = scene.emitters();
  constexpr size_t kCells = kStrips * kStrips;
  constexpr int count = 30000;
  std::vector<double> observed(emitters.size() * kCells + 1), expected(observed.size());
  expected.back() = count;
  constexpr int kGrid = 64;
  for (size_t i = 0; i < emitters.size(); ++i)
    for (int k = 0; k < kGrid * kGrid; ++k) {
      const EmissiveTriangle& e = emitters[i];
      const Vec2 b = squareToTriangle(Vec2(static_cast<float>(k % kGrid) + 0.5f, static_cast<float>(k / kGrid) + 0.5f) /
                                      float(kGrid));
      const Vec3 q = e.p0 + b.x * e.e1 + b.y * e.e2, d = q - p;
      const float distance = glm::length(d), facing = -glm::dot(d, e.normal) / distance;
      const float cosine = e.twoSided ? std::fabs(facing) : facing;
      if (!(cosine > 0) || (!twoSided && glm::dot(d, n) <= 0)) continue;
      const float share = lights.pdfEmitter({p, n, twoSided}, i, distance, cosine) * cosine / sqr(distance) * e.area;
      const double samples = count * static_cast<double>(share) / (kGrid * kGrid);
      expected[i * kCells + cellOf(e, q)] += samples;
      expected.back() -= samples;
    }
  for (int k = 0; k < count; ++k) {
    LightSample s;
    const float select = rng.next();
    if (!lights.sample({p, n, twoSided}, select, rng.next2(), s)) {
      observed.back() += 1;
      continue;
    }
    size_t found = 0;
    float best = kInfinity;
    for (size_t i = 0; i < emitters.size(); ++i) {
      const float off = std::fabs(distanceTo(emitters[i], p, s.wi) - s.distance);
      if (off < best) best = off, found = i;
    }
    // A point on the very edge of its triangle may be missed by the ray to it.
    if (best < kInfinity) observed[found * kCells + cellOf(emitters[found], p + s.distance * s.wi)] += 1;
  }
  return test::pValueOf(observed, expected);
}

// The probability of choosing emitter i, out of its density at its centre.
double choiceOf(const Scene& scene, const LightSampler& lights, const Vec3& p, const Vec3& n, size_t i) {
  const EmissiveTriangle& e = scene.emitters()[i];
  const Vec3 d = e.p0 + (e.e1 + e.e2) / 3.0f - p;
  const float distance = glm::length(d), cosine = std::fabs(glm::dot(d, e.normal)) / distance;
  const double density =
      static_cast<double>(sqr(distance)) / (static_cast<double>(cosine) * static_cast<double>(e.area));
  return static_cast<double>(lights.pdfEmitter({p, n}, i, distance, cosine)) / density;
}

}  // namespace

TEST_CASE("Points on emissive triangles are drawn with the density that the sampler states") {
  Rng rng(1);
  constexpr int kTests = 12;
  for (int i = 0; i < kTests; ++i) {
    const Scene scene(randomEmitters(rng, i < 4 ? 1 : 7, 3, i % 2 ? 1.0f : 2.5f));
    const LightSampler lights(scene, i % 4 < 2 ? LightStrategy::Hierarchy : LightStrategy::Power);
    const Vec3 p = 0.5f * randomPoint(rng), n = randomDirection(rng);
    CAPTURE(i);
    CHECK(emittersPValue(scene, lights, p, n, i % 3 == 0, rng) > test::sidak(kFalseAlarm, kTests));
  }
}

TEST_CASE("A sample's density is the one that the same direction has as a hit") {
  Rng rng(2);
  for (int i = 0; i < 50; ++i) {
    const Scene scene(randomEmitters(rng, 1 + i % 9, 3, 1));
    for (const LightStrategy strategy : {LightStrategy::Hierarchy, LightStrategy::Power}) {
      const LightSampler lights(scene, strategy);
      const Vec3 p = randomPoint(rng), n = randomDirection(rng);
      LightSample s;
      const float select = rng.next();
      if (!lights.sample({p, n}, select, rng.next2(), s)) continue;
      float best = kInfinity, stated = 0;
      for (size_t e = 0; e < scene.emitters().size(); ++e) {
        const float distance = distanceTo(scene.emitters()[e], p, s.wi);
        if (!(std::fabs(distance - s.distance) < best)) continue;
        best = std::fabs(distance - s.distance);
        stated = lights.pdfEmitter({p, n}, e, distance, std::fabs(glm::dot(s.wi, scene.emitters()[e].normal)));
      }
      if (best < 1e-3f) CHECK(s.pdfW == doctest::Approx(stated).epsilon(2e-3));
    }
  }
}

TEST_CASE("Choosing by the hierarchy has no more variance than choosing by power") {
  Rng rng(7);
  const Scene scene(randomEmitters(rng, 200, 10, 0.5f));
  const LightSampler hierarchy(scene, LightStrategy::Hierarchy), power(scene, LightStrategy::Power);
  double varianceOfHierarchy = 0, varianceOfPower = 0;
  int worse = 0;
  constexpr int kPoints = 500;
  for (int k = 0; k < kPoints; ++k) {
    const Vec3 p = 10.0f * randomPoint(rng), n = randomDirection(rng);
    // With irradiances f_i of the emitters and chances q_i, the variance of f_i / q_i is Σ f_i² / q_i - (Σ f_i)².
    double sum = 0, second[2] = {0, 0};
    for (size_t i = 0; i < scene.emitters().size(); ++i) {
      const EmissiveTriangle& e = scene.emitters()[i];
      const Vec3 d = e.p0 + (e.e1 + e.e2) / 3.0f - p;
      const float distance2 = glm::dot(d, d), distance = std::sqrt(distance2);
      const float cosLight = -glm::dot(d, e.normal) / distance, cosHere = glm::dot(d, n) / distance;
      const float facing = e.twoSided ? std::fabs(cosLight) : cosLight;
      if (facing <= 1e-3f || cosHere <= 1e-3f) continue;
      const double f = static_cast<double>(average(e.meanRadiance) * e.area * facing * cosHere / distance2);
      sum += f;
      second[0] += f * f / choiceOf(scene, hierarchy, p, n, i);
      second[1] += f * f / choiceOf(scene, power, p, n, i);
    }
    // Relative to the irradiance, so that no point counts for all.
    if (sum == 0) continue;
    varianceOfHierarchy += second[0] / (sum * sum) - 1;
    varianceOfPower += second[1] / (sum * sum) - 1;
    worse += second[0] > second[1];
  }
  MESSAGE("variance of the hierarchy over that of power: ", varianceOfHierarchy / varianceOfPower);
  CHECK(varianceOfHierarchy < 0.5 * varianceOfPower);
  CHECK(worse < kPoints / 20);
}

TEST_CASE("Finite, directional and environment light add up to the irradiance") {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0), Spectrum(5))};
  TriangleMesh quad;
  addQuad(quad, {-0.5f, 2, -0.5f}, {1, 0, 0}, {0, 0, 1});
  addMesh(data, std::move(quad), 0);
  data.environment.emplace().radiance = Spectrum(0.5f);
  data.lights.resize(3);
  data.lights[0].kind = PunctualKind::Directional;
  data.lights[0].direction = glm::normalize(Vec3(1, -2, 0));
  data.lights[0].intensity = Spectrum(3);
  data.lights[1].position = {1, 1, 0};
  data.lights[1].intensity = Spectrum(2);
  data.lights[2].kind = PunctualKind::Spot;
  data.lights[2].position = {0, 1.5f, 0.5f};
  data.lights[2].direction = {0, -1, 0};
  data.lights[2].innerConeAngle = 0.5f;
  data.lights[2].outerConeAngle = 0.6f;
  data.lights[2].intensity = Spectrum(4);
  const Scene scene(std::move(data));

  // By hand, for a floor at the origin; the quad by a fine grid.
  double expected = 0.5 * static_cast<double>(kPi) + 3 * 2 / std::sqrt(5.0) + 2 / (2 * std::sqrt(2.0));
  expected += 4 * 1.5 / std::pow(1.5 * 1.5 + 0.25, 1.5);
  constexpr int kGrid = 100;
  for (int i = 0; i < kGrid; ++i)
    for (int j = 0; j < kGrid; ++j) {
      const double x = (i + 0.5) / kGrid - 0.5, z = (j + 0.5) / kGrid - 0.5;
      expected += 5 * 4 / sqr(x * x + z * z + 4) / (kGrid * kGrid);
    }
  for (const LightStrategy strategy : {LightStrategy::Hierarchy, LightStrategy::Power}) {
    const LightSampler lights(scene, strategy);
    Rng rng(11);
    constexpr int kSamples = 200000;
    double sum = 0, squares = 0;
    for (int i = 0; i < kSamples; ++i) {
      LightSample s;
      const float select = rng.next();
      if (!lights.sample({Vec3(0), {0, 1, 0}}, select, rng.next2(), s) || s.wi.y <= 0) continue;
      const double value = static_cast<double>(s.radiance.x * s.wi.y / s.pdfW);
      sum += value;
      squares += value * value;
    }
    const double mean = sum / kSamples, deviation = std::sqrt((squares / kSamples - mean * mean) / kSamples);
    // 3.9 standard deviations: a false alarm in 10⁴ runs for each strategy.
    CHECK(std::fabs(mean - expected) < 3.9 * deviation);
  }
}

TEST_CASE("Punctual lights end at their range and outside their cone") {
  SceneData data;
  data.lights.resize(1);
  PunctualLight& light = data.lights[0];
  light.kind = PunctualKind::Spot;
  light.direction = {0, -1, 0};
  light.position = {0, 2, 0};
  light.range = 3;
  light.outerConeAngle = 0.5f;
  const Scene scene(std::move(data));
  const LightSampler lights(scene, LightStrategy::Automatic);
  LightSample s;
  CHECK(lights.sample({{0, 0, 0}, {0, 1, 0}}, 0.5f, Vec2(0.5f), s));
  CHECK(s.delta);
  CHECK(s.pdfW == 1);
  const double atTwoThirds = 1 - 16.0 / 81;  // the window of KHR_lights_punctual
  CHECK(s.radiance.x == doctest::Approx(0.25 * atTwoThirds));
  CHECK_FALSE(lights.sample({{0, -1.1f, 0}, {0, 1, 0}}, 0.5f, Vec2(0.5f), s));
  CHECK_FALSE(lights.sample({{1.5f, 0, 0}, {0, 1, 0}}, 0.5f, Vec2(0.5f), s));
}

TEST_CASE("A scene without light has nothing to draw") {
  const Scene scene{SceneData()};
  const LightSampler lights(scene, LightStrategy::Automatic);
  LightSample s;
  CHECK_FALSE(lights.sample({Vec3(0), {0, 1, 0}}, 0.5f, Vec2(0.5f), s));
  CHECK(lights.pdfEnvironment({Vec3(0), Vec3(0, 1, 0)}, {0, 1, 0}) == 0);
}

}  // namespace braid::test_lights
