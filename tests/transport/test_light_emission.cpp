// SPDX-License-Identifier: Apache-2.0
// Light subpaths start with the densities they claim and carry the power of their lights.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/transport/light_emission.h"
#include "renderer/transport/light_reach.h"
#include "tests/support/statistics/chi_squared.h"
#include "tests/support/render_fixture.h"

namespace braid::test_light_emission {

using namespace test;

namespace {

SceneData darkBox() {
  SceneData data = cornellBox();
  for (Material& m : data.materials) m.emission = Spectrum(0);
  return data;
}

PunctualLight punctual(PunctualKind kind) {
  PunctualLight light;
  light.kind = kind;
  light.position = {0.2f, 0.3f, -0.1f};
  light.direction = glm::normalize(Vec3(0.3f, -0.8f, 0.5f));
  light.outerConeAngle = 0.7f;
  light.innerConeAngle = 0.2f;
  light.intensity = Spectrum(3, 2, 1);
  return light;
}

// One scene for every kind of light.
std::vector<std::pair<std::string, SceneData>> lightKinds() {
  std::vector<std::pair<std::string, SceneData>> kinds;
  kinds.emplace_back("triangles", cornellBox());
  SceneData twoSided = cornellBox();
  for (Material& m : twoSided.materials) m.doubleSided = true;
  kinds.emplace_back("two-sided triangles", std::move(twoSided));
  for (const PunctualKind kind : {PunctualKind::Point, PunctualKind::Spot, PunctualKind::Directional}) {
    SceneData data = darkBox();
    data.lights = {punctual(kind)};
    kinds.emplace_back("punctual " + std::to_string(static_cast<int>(kind)), std::move(data));
  }
  SceneData sky = darkBox();
  sky.environment.emplace().radiance = Spectrum(1, 2, 3);
  kinds.emplace_back("environment", std::move(sky));
  return kinds;
}

LightStart draw(const LightEmission& emission, Rng& rng) {
  LightStart start;
  const double select = static_cast<double>(rng.next()) + static_cast<double>(rng.next()) * 0x1p-24;
  const Vec2 position = rng.next2();
  if (!emission.sample(select, position, rng.next2(), 0, start)) start.throughput = Spectrum(0);
  return start;
}

}  // namespace

TEST_CASE("Light subpaths carry the power of their lights, and know their densities") {
  for (auto& [name, data] : lightKinds()) {
    const Scene scene(std::move(data));
    const LightSampler lights(scene, LightStrategy::Power);
    const LightEmission emission(scene, lights);
    CAPTURE(name);
    Rng rng(1);
    double sum = 0, squares = 0;
    constexpr int kSamples = 20000;
    for (int i = 0; i < kSamples; ++i) {
      const LightStart s = draw(emission, rng);
      const double power = static_cast<double>(average(s.throughput));
      sum += power;
      squares += power * power;
      CHECK(s.pdfEmit == doctest::Approx(emission.pdfEmit(s.light, s.direction, s.cosLight, 0)).epsilon(1e-5));
      CHECK(std::fabs(glm::length(s.direction) - 1) < 1e-4f);
      CHECK(glm::dot(s.direction, s.normal) > 0);
    }
    const double mean = sum / kSamples, error = std::sqrt(std::max(0.0, squares / kSamples - mean * mean) / kSamples);
    // Spots lose what their falloff takes from the power that guides the choice; all others carry exactly that power.
    const bool spot = !scene.lights().empty() && scene.lights()[0].kind == PunctualKind::Spot;
    if (spot)
      CHECK((mean > 0.2 * emission.power() && mean < emission.power()));
    else
      CHECK(std::fabs(mean - emission.power()) <= kSigmas * error + 1e-4 * emission.power());
  }
}

TEST_CASE("Lights are chosen with their probabilities, also among a hundred thousand") {
  SceneData data = darkBox();
  for (int i = 0; i < 100000; ++i) {
    PunctualLight light = punctual(PunctualKind::Point);
    light.intensity = Spectrum(i % 7 == 0 ? 0.0f : 1 + static_cast<float>(i % 3));
    data.lights.push_back(light);
  }
  const Scene scene(std::move(data));
  const LightSampler lights(scene, LightStrategy::Power);
  const LightEmission emission(scene, lights);
  double total = 0;
  std::array<double, 21> expected{}, counted{};
  for (uint32_t i = 0; i < lights.size(); ++i) {
    total += emission.probability(i);
    expected[i % 21] += emission.probability(i);
  }
  CHECK(total == doctest::Approx(1).epsilon(1e-12));
  Rng rng(2);
  constexpr int kSamples = 200000;
  for (int i = 0; i < kSamples; ++i) {
    const LightStart s = draw(emission, rng);
    CHECK(emission.probability(s.light) > 0);
    counted[s.light % 21] += 1;
  }
  double chi2 = 0;
  int cells = 0;
  for (size_t k = 0; k < expected.size(); ++k) {
    if (expected[k] == 0) {
      CHECK(counted[k] == 0);
      continue;
    }
    chi2 += sqr(counted[k] - kSamples * expected[k]) / (kSamples * expected[k]);
    ++cells;
  }
  CHECK(gammaQ(0.5 * (cells - 1), 0.5 * chi2) > 1e-4);  // the false-alarm rate
}

TEST_CASE("Usefulness shifts the choice and not the power that is carried") {
  SceneData data = darkBox();
  data.lights = {punctual(PunctualKind::Point), punctual(PunctualKind::Point)};
  const Scene scene(std::move(data));
  const LightSampler lights(scene, LightStrategy::Power);
  const LightEmission emission(scene, lights, {0.25f, 0.75f});
  CHECK(emission.probability(0) == doctest::Approx(0.25));
  Rng rng(3);
  double sum = 0, squares = 0;
  constexpr int kSamples = 4000;
  for (int i = 0; i < kSamples; ++i) {
    const double p = static_cast<double>(average(draw(emission, rng).throughput));
    sum += p;
    squares += p * p;
  }
  const double mean = sum / kSamples, error = std::sqrt((squares / kSamples - mean * mean) / kSamples);
  CHECK(std::fabs(mean - emission.power()) < kSigmas * error);
}

TEST_CASE("A starting point and its density see the same probability of being chosen by next-event estimation") {
  // pdfDirect() of the point where light sampling arrived is the density of that sample, for every kind of light.
  for (auto& [name, data] : lightKinds()) {
    const Scene scene(std::move(data));
    const LightSampler lights(scene, LightStrategy::Automatic);
    CAPTURE(name);
    Rng rng(4);
    int found = 0;
    for (int i = 0; i < 500; ++i) {
      const Vec3 p(rng.next() - 0.5f, -0.9f, rng.next() - 0.5f), n(0, 1, 0);
      LightSample s;
      const float select = rng.next();
      if (!lights.sample({p, n}, select, rng.next2(), s)) continue;
      ++found;
      float direct = lights.pdfDirect(s.light, {p, n}, s.wi);
      if (s.light < lights.firstPositional()) {
        const float cosine = std::fabs(glm::dot(s.wi, scene.emitters()[s.light].normal));
        direct *= sqr(s.distance) / cosine;
      }
      CHECK(direct == doctest::Approx(s.pdfW).epsilon(1e-4));
    }
    CHECK(found > 50);
  }
}

namespace {

// Of the Cornell box with its lamp scaled, and a ball of glass, of metal of a roughness, or none.
LightReach reachOf(float lampScale, bool ball, float metalRoughness = -1) {
  SceneData data = cornellBox();
  for (TriangleMesh& mesh : data.meshes) {
    if (!data.materials[mesh.material].emissive()) continue;
    Vec3 centre(0);
    for (const Vec3& p : mesh.positions) centre += p / static_cast<float>(mesh.positions.size());
    for (Vec3& p : mesh.positions) p = centre + (p - centre) * lampScale;
  }
  if (ball) {
    Material material = diffuseMaterial(Spectrum(1));
    if (metalRoughness >= 0) {
      material.metallic = 1;
      material.roughness = metalRoughness;
    } else {
      material.transmission = material.specular = 1;
      material.roughness = 0;
      material.thinWalled = false;
    }
    data.materials.push_back(material);
    TriangleMesh sphere;
    addSphere(sphere, {0.3f, 0.3f, 0.3f}, 0.35f, 3);
    addMesh(data, std::move(sphere), static_cast<uint32_t>(data.materials.size() - 1));
  }
  const Scene scene(std::move(data));
  const TransportContext context(scene);
  return measureLightReach(context, Camera(scene.data().cameras.at(0), 64, 64), 64, 64);
}

}  // namespace

TEST_CASE("The reach of light tells a caustic of a small lamp from one of a large lamp, and from none") {
  const LightReach none = reachOf(1, false), large = reachOf(1, true), small = reachOf(0.02f, true);
  CHECK(none.caustic == 0);
  CHECK(none.direct + none.indirect == doctest::Approx(1));
  CHECK(large.caustic > 0.01);
  CHECK(small.caustic > 0.01);
  CHECK(large.causticVariance < 20);
  CHECK(small.causticVariance > 100 * large.causticVariance);
  CHECK(small.causticBySmooth == small.caustic);
  const LightReach again = reachOf(1, true);
  CHECK(again.caustic == large.caustic);
  CHECK(again.causticVariance == large.causticVariance);
}

TEST_CASE("Light samples find what rough surfaces focus: however small the lamp, it is no rare light") {
  const LightReach rough = reachOf(0.02f, true, 0.3f), smooth = reachOf(0.02f, true, 0);
  CHECK(rough.caustic > 0.001);
  CHECK(rough.causticBySmooth == 0);
  CHECK(rough.causticVariance < 100 * rough.caustic);  // one direction in a hundred at worst
  CHECK(smooth.causticBySmooth == smooth.caustic);
  CHECK(smooth.causticVariance > 1000 * smooth.caustic);
}

}  // namespace braid::test_light_emission
