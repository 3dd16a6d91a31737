// SPDX-License-Identifier: Apache-2.0
// Paths that go on from their first surface in several directions: the same mean as with one, the same bits for any
// number of threads, crop and resumed run, a variance that is true, and as many directions as pay. False-alarm rates
// are those of disagreement() and zScore().
#include <doctest/doctest.h>

#include <fmt/format.h>

#include "braid/place_samples.h"
#include "integrators/path_preparation.h"
#include "renderer/core/error.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/contains.h"
#include "tests/support/statistics/calibration.h"
#include "tests/support/statistics/pass_means.h"

namespace braid::test_path_splits {

using namespace test;

namespace {

Scene suiteScene(const std::string& name) { return Scene(loadGltf(sourcePath("scenes/" + name + ".glb"))); }

Settings split(Settings s, int splits, int lightSamples = 1) {
  s.pathSplits = splits;
  s.lightSamples = lightSamples;
  return s;
}

// Nothing is clamped: of fewer, brighter samples that would take more.
double disagreementOf(const Scene& scene, int splits, int width, int height, uint64_t spp) {
  const Settings many = split(settingsOf("pt", width, height, spp, 1), splits, 2),
                 one = split(settingsOf("pt", width, height, spp, 2), 1);
  return disagreement(passMeans(scene, many, 4), passMeans(scene, one, 4));
}

Session sessionOf(const Scene& scene, const Settings& settings) {
  return Session(scene, makePlan(scene, scene.data().cameras.at(0), settings, integrators()));
}

std::string decisionOf(const Scene& scene, const Settings& settings, int& splits) {
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  const PathPreparation prepared(TransportContext(scene, settings.lightStrategy), plan);
  splits = prepared.aids().splits;
  return prepared.decisions().empty() ? "" : prepared.decisions().back().reason;
}

}  // namespace

TEST_CASE("path splits: the mean is that of one direction") {
  CHECK(disagreementOf(Scene(cornellBox()), 4, 12, 12, 400) < 1);
  CHECK(disagreementOf(Scene(cornellBox()), 3, 12, 12, 400) < 1);
  // Metal, rough glass, coatings, sheen; media behind panes and glass; coverage and the sky; a sun.
  for (const char* name : {"materials", "glass_of_water", "plates", "foliage", "sun_sky"}) {
    CAPTURE(std::string(name));
    CHECK(disagreementOf(suiteScene(name), 4, 12, 8, 300) < 1);
  }
}

TEST_CASE("path splits: another expectation is told apart") {
  const Scene box(cornellBox());
  Settings with = split(settingsOf("pt", 12, 12, 400, 1), 4), without = split(settingsOf("pt", 12, 12, 400, 2), 1);
  with.maxDepth = 4;
  CHECK(disagreement(passMeans(box, with, 4), passMeans(box, without, 4)) > 1);
}

TEST_CASE("path splits: in a furnace every pixel has the radiance of the walls") {
  for (const double albedo : {0.3, 0.9}) {
    const Settings settings = split(settingsOf("pt", 20, 20, 64), kMostPathSplits);
    const double expected = 0.5 * (1 - std::pow(albedo, settings.maxDepth)) / (1 - albedo);
    CHECK(zScore(meanOf(render(furnace(static_cast<float>(albedo), 0.5f), settings)), expected) < kSigmas);
  }
}

TEST_CASE("path splits: the same bits for any number of threads") {
  for (const char* name : {"cornell", "glass_of_water"}) {
    const Scene scene = suiteScene(name);
    std::vector<RenderResult> results;
    for (const int threads : {1, 2, 5}) {
      Settings settings = split(settingsOf("pt", 40, 24, 4, 0, SamplerKind::Sobol), kMostPathSplits);
      settings.threads = threads;
      results.push_back(render(scene, settings));
    }
    CHECK(sameBits(estimateOf(results[0]), estimateOf(results[1])));
    CHECK(sameBits(estimateOf(results[0]), estimateOf(results[2])));
  }
}

TEST_CASE("path splits: crops and resumed runs are those of the whole") {
  const Scene scene = suiteScene("glass_of_water");
  const Settings settings = split(settingsOf("pt", 48, 27, 8, 0, SamplerKind::Sobol), 4);
  const Rgb<float> image = sessionOf(scene, settings).run().image;

  Settings part = settings;
  part.crop = PixelWindow{7, 5, 30, 20};
  const Rgb<float> crop = sessionOf(scene, part).run().image;
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < crop.height(); ++y)
      for (int x = 0; x < crop.width(); ++x) CHECK(crop[c].at(x, y) == image[c].at(7 + x, 5 + y));

  part = settings;
  part.spp = 3;
  Session begun = sessionOf(scene, part);
  begun.advance();
  Session resumed = sessionOf(scene, settings);
  resumed.resume(begun.release(), "state");
  CHECK(sameBits(resumed.run().image, image));
}

TEST_CASE("path splits: a state is gone on with as it was begun") {
  const Scene scene(cornellBox());
  Session one = sessionOf(scene, split(settingsOf("pt", 20, 12, 2), 1));
  one.advance();
  Session four = sessionOf(scene, split(settingsOf("pt", 20, 12, 2), 4));
  CHECK_THROWS_AS(four.resume(one.release(), "state"), Error);
}

TEST_CASE("path splits: the variance is true") {
  const Scene scene(cornellBox());
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
    const Settings settings = split(clampedSettings(24, 24, 16, sampler, 0), 4);
    const bool independent = sampler == SamplerKind::Independent;
    checkCalibrated(independent ? "path splits, independent" : "path splits, sobol",
                    reportedOverEmpirical(scene, settings, 192));
  }
}

TEST_CASE("path splits: four directions leave less than half of the variance of indirect light") {
  const Scene scene(cornellBox());
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
    double variance[2] = {0, 0};
    for (const int k : {0, 1}) {
      const RenderResult r = render(scene, split(clampedSettings(48, 48, 32, sampler, 0), k == 0 ? 1 : 4));
      for (const float v : estimateOf(r).variance[1].data) variance[k] += static_cast<double>(v);
    }
    MESSAGE("variance of one over that of four: ", variance[0] / variance[1]);
    CHECK(variance[1] < 0.5 * variance[0]);
  }
}

// Placed passes make the points of their branches by themselves.
TEST_CASE("path splits: placed samples have the same mean, and the same bits for any number of threads") {
  const Scene scene(cornellBox());
  Settings plain = split(settingsOf("pt", 24, 24, 48, 1, SamplerKind::Sobol), 4), placed = plain;
  placed.placement = "none";
  placed.seed = 2;
  std::vector<RenderResult> results;
  for (const int threads : {1, 2, 5}) {
    placed.threads = threads;
    Session session = sessionOf(scene, placed);
    session.placeBy(errorsForPlacement(placed.placement));
    results.push_back(session.run());
  }
  CHECK_FALSE(estimateOf(results[0]).samples.empty());
  CHECK(sameBits(estimateOf(results[0]).mean, estimateOf(results[1]).mean));
  CHECK(sameBits(estimateOf(results[0]).mean, estimateOf(results[2]).mean));
  CHECK(zScore(meanOf(results[0]), meanOf(render(scene, plain))) < kSigmas);
}

TEST_CASE("path splits: as many as the shares of variance and cost ask for") {
  CHECK(pathSplitsThatPay({0, 0.1}, {}) == 1);
  CHECK(pathSplitsThatPay({0.6, 0.8}, {}) == 1);
  CHECK(pathSplitsThatPay({0.8, 0.3}, {}) == 4);
  CHECK(pathSplitsThatPay({0.7, 0.3}, {}) == 2);
  // The parts agree, or one of them makes all of the gain.
  const std::vector<SampleShares> agree(16, {0.8, 0.3});
  std::vector<SampleShares> one = agree;
  one[3].variance = 0.6;
  CHECK(sampleGainError(agree, 4) == doctest::Approx(0));
  CHECK(sampleGainError(one, 4) == doctest::Approx((sampleGain(agree[0], 4) - sampleGain(one[3], 4)) * 15 / 16));
  CHECK(pathSplitsThatPay({0.8, 0.3}, agree) == 4);
  CHECK(pathSplitsThatPay({0.8, 0.3}, one) == 1);
  CHECK(sampleGain({0.8, 0.3}, 4) == doctest::Approx(1 / (0.4 * 1.9)));
}

TEST_CASE("path splits: measured in frames that are worth it, and said") {
  int splits = 0;
  const Settings frame = split(settingsOf("pt", 256, 144, 1, 0, SamplerKind::Sobol), 0, 0);
  const std::string kept = decisionOf(Scene(cornellBox()), frame, splits);
  CHECK(splits >= 2);
  CHECK(contains(kept, fmt::format("{} directions from the first surface", splits)));
  // The noise of lamps is none of theirs.
  CHECK(contains(decisionOf(suiteScene("plates"), frame, splits), "direct light is"));
  CHECK(splits == 1);
  CHECK(decisionOf(Scene(cornellBox()), split(settingsOf("pt", 64, 36, 1), 0, 0), splits).empty());
  CHECK(splits == 1);
  decisionOf(Scene(cornellBox()), split(frame, 6), splits);
  CHECK(splits == 6);
}

}  // namespace braid::test_path_splits
