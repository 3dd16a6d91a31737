// SPDX-License-Identifier: Apache-2.0
// Several light samples at a path's first surface: the same mean as with one, the same bits for any number of threads,
// a variance that is true, and as many as pay. False-alarm rates are those of disagreement() and zScore().
#include <doctest/doctest.h>

#include <fmt/format.h>

#include "integrators/guiding/pixel_grid.h"
#include "integrators/path_preparation.h"
#include "renderer/core/error.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/contains.h"
#include "tests/support/statistics/calibration.h"
#include "tests/support/statistics/pass_means.h"

namespace braid::test_light_samples {

using namespace test;

namespace {

Scene suiteScene(const std::string& name) { return Scene(loadGltf(sourcePath("scenes/" + name + ".glb"))); }

Settings withSamples(Settings s, int count) {
  s.lightSamples = count;
  s.pathSplits = 1;
  return s;
}

// Nothing is clamped: of fewer, brighter samples that would take more.
double disagreementOf(const Scene& scene, int width, int height, uint64_t spp) {
  const Settings many = withSamples(settingsOf("pt", width, height, spp, 1), 5),
                 one = withSamples(settingsOf("pt", width, height, spp, 2), 1);
  return disagreement(passMeans(scene, many, 4), passMeans(scene, one, 4));
}

std::string decisionOf(const Scene& scene, const Settings& settings, int& count) {
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  const PathPreparation prepared(TransportContext(scene, settings.lightStrategy), plan);
  count = prepared.aids().lightSamples;
  return prepared.decisions().empty() ? "" : prepared.decisions().back().reason;
}

}  // namespace

TEST_CASE("light samples: the mean is that of one") {
  CHECK(disagreementOf(Scene(cornellBox()), 12, 12, 600) < 1);
  // Lamps of all sizes, coatings; media behind panes and glass; coverage and the sky; a sun.
  for (const char* name : {"plates", "glass_of_water", "foliage", "sun_sky"}) {
    CAPTURE(std::string(name));
    CHECK(disagreementOf(suiteScene(name), 12, 8, 300) < 1);
  }
}

TEST_CASE("light samples: in a furnace every pixel has the radiance of the walls") {
  const Settings settings = withSamples(settingsOf("pt", 20, 20, 64), 7);
  const double expected = 0.5 * (1 - std::pow(0.5, settings.maxDepth)) / 0.5;
  CHECK(zScore(meanOf(render(furnace(0.5f, 0.5f), settings)), expected) < kSigmas);
}

TEST_CASE("light samples: more than a batch of shadow rays, and the same bits for any number of threads") {
  const Scene scene(cornellBox());
  std::vector<RenderResult> results;
  for (const int threads : {1, 2, 5}) {
    Settings settings = withSamples(settingsOf("pt", 40, 24, 4, 0, SamplerKind::Sobol), kMostLightSamples);
    settings.threads = threads;
    results.push_back(render(scene, settings));
  }
  CHECK(sameBits(estimateOf(results[0]), estimateOf(results[1])));
  CHECK(sameBits(estimateOf(results[0]), estimateOf(results[2])));
}

TEST_CASE("light samples: the variance is true") {
  const Scene scene(cornellBox());
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
    const Settings settings = withSamples(clampedSettings(24, 24, 16, sampler, 0), 3);
    const bool independent = sampler == SamplerKind::Independent;
    checkCalibrated(independent ? "light samples, independent" : "light samples, sobol",
                    reportedOverEmpirical(scene, settings, 192));
  }
}

TEST_CASE("light samples: numbers lie in [0, 1) and are spread") {
  SampleBlock block;
  for (const float u : {0.0f, 0.3f, 0.5f, kOneMinusEpsilon}) {
    block.u.fill(u);
    for (int k = 0; k < kMostLightSamples; ++k) {
      const LightChoice c = lightChoice(block, k, kMostLightSamples);
      for (const float v : {c.select, c.place.x, c.place.y}) CHECK((v >= 0 && v < 1));
    }
    const LightChoice first = lightChoice(block), second = lightChoice(block, 1, 2);
    CHECK(first.select == u);
    CHECK(std::abs(std::abs(second.select - u) - 0.5f) < 1e-6f);
  }
}

TEST_CASE("light samples: as many as the shares of variance and cost ask for") {
  CHECK(lightSamplesThatPay({0, 0.1}) == 1);
  CHECK(lightSamplesThatPay({0.5, 0.2}) == 1);  // they gain, but too little to be believed
  CHECK(lightSamplesThatPay({0.8, 0.25}) == 3);
  CHECK(lightSamplesThatPay({1, 0}) == 4);
  CHECK(sampleGain({0.6, 0.2}, 2) == doctest::Approx(1 / (0.7 * 1.2)));
}

TEST_CASE("light samples: what is measured again is measured elsewhere") {
  Settings frame;
  frame.width = 320;
  frame.height = 180;
  const PixelGrid first(frame, 300), others(frame, 300, true);
  REQUIRE(others.size() == first.size());
  for (size_t i = 0; i < first.size(); ++i) {
    CHECK(others.x(i) < first.x(i));
    CHECK(others.y(i) < first.y(i));
  }
}

TEST_CASE("light samples: where they pay chance seldom hides it, even in a small frame") {
  int found = 0;
  for (const char* name : {"hair", "plates"}) {
    const Scene scene = suiteScene(name);
    for (uint64_t seed = 1; seed <= 24; ++seed) {
      Settings frame = withSamples(settingsOf("pt", 256, 144, 1, 0, SamplerKind::Sobol), 0);
      frame.seed = seed;
      int count = 0;
      decisionOf(scene, frame, count);
      found += count >= 2 ? 1 : 0;
    }
  }
  CHECK(found >= 41);  // of 48
}

TEST_CASE("light samples: measured in frames that are worth it, and said") {
  int count = 0;
  const Settings frame = withSamples(settingsOf("pt", 256, 144, 1, 0, SamplerKind::Sobol), 0);
  const std::string kept = decisionOf(suiteScene("plates"), frame, count);
  CHECK(count >= 2);
  CHECK(contains(kept, fmt::format("{} at the first surface", count)));
  // Points of low discrepancy leave no noise in a soft shadow that more samples would take away.
  const std::string left = decisionOf(Scene(cornellBox()), frame, count);
  CHECK(count == 1);
  CHECK(contains(left, "would not pay"));
  CHECK(decisionOf(Scene(cornellBox()), withSamples(settingsOf("pt", 64, 36, 1), 0), count).empty());
  CHECK(count == 1);
  decisionOf(Scene(cornellBox()), withSamples(frame, 6), count);
  CHECK(count == 6);
}

TEST_CASE("light samples: a state is gone on with as it was begun") {
  const Scene scene(cornellBox());
  const auto sessionOf = [&](int count) {
    return Session(scene, makePlan(scene, scene.data().cameras.at(0), withSamples(settingsOf("pt", 20, 12, 2), count),
                                   integrators()));
  };
  Session one = sessionOf(1);
  one.advance();
  Session three = sessionOf(3);
  CHECK_THROWS_AS(three.resume(one.release(), "state"), Error);
}

}  // namespace braid::test_light_samples
