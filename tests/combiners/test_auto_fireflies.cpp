// SPDX-License-Identifier: Apache-2.0
// The removal of fireflies in "auto", which leaves lamps alone.
#include <algorithm>
#include <array>
#include <limits>
#include <random>

#include <doctest/doctest.h>

#include "combiners/pipeline/method_names.h"
#include "combiners/statistics/fireflies.h"
#include "combiners/shrinkage/fused_estimate.h"
#include "combiners/pipeline/pipeline.h"
#include "tests/combiners/auto_cases.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_auto_fireflies {

using namespace test;
using namespace test::auto_cases;

TEST_CASE("A firefly that both images hold makes no noise of the pixels around it") {
  // Its smoothed variances decide the weights of the whole window; the noise of a pixel stays its own.
  Estimate x = flat(1.0f, 1e-3f), s = flat(1.0f, 3e-3f);
  s.bias = s.biasVariance = Rgb<float>(40, 30);
  const size_t firefly = x.mean[0].index(20, 15);
  for (Estimate* e : {&x, &s}) setPixel(*e, firefly, 226, {1, 901, 1, 1}, 5e4f);
  const FusedEstimate f = fusedEstimate(x, {&s}, nullptr);
  CHECK(f.noise[0][firefly] > 1e4f);
  for (const size_t beside : {firefly + 1, firefly - 3, firefly + 3 * 40}) {
    // Weights of about 1/2 each, for the firefly's errors are alike.
    CHECK(f.noise[1][beside] == doctest::Approx(0.25 * 1e-3 + 0.25 * 3e-3).epsilon(0.01));
    CHECK(f.image.variance[1][beside] == f.noise[1][beside]);
  }
}

TEST_CASE("A firefly of the photon map does not take the caustic around it") {
  Estimate x = flat(0.1f, 1e-6f), s = flat(0.5f, 1e-3f);
  s.unbiased = false;
  s.bias = s.biasVariance = Rgb<float>(40, 30);
  const size_t firefly = s.mean[0].index(20, 15);
  setPixel(s, firefly, 200, {797, 1, 1, 1}, 4e4f);
  const FusedEstimate f = fusedEstimate(x, {&s}, nullptr);
  for (const size_t beside : {firefly + 1, firefly - 2 * 40, firefly + 6 * 40 - 6})
    CHECK(f.image.mean[1][beside] == doctest::Approx(0.5).epsilon(0.05));
  CHECK(f.image.mean[1][firefly] < 1);  // its own pixel it does take
}

TEST_CASE("A firefly in one quarter is replaced, a lamp in all of them stays") {
  Estimate x = flat(1.0f, 1e-4f);
  const size_t firefly = x.mean[0].index(10, 10), lamp = x.mean[0].index(30, 20);
  setPixel(x, firefly, 50, {197, 1, 1, 1}, 2400);
  setPixel(x, lamp, 50, {49, 51, 50, 50}, 2400);
  const std::vector<Firefly> fireflies = findFireflies(x, {&x.quarter}, nullptr);
  REQUIRE(fireflies.size() == 1);
  CHECK(fireflies[0].index == firefly);
  Rgb<float> image = x.mean, variance = x.variance;
  replaceValues(image, fireflies);
  replaceVariances(variance, fireflies);
  CHECK(variance[2][firefly] == doctest::Approx(1e-4));
  CHECK(image[1][firefly] == doctest::Approx(1.0));
  CHECK(image[1][lamp] == 50.0f);
  // Quarters in other units, and one with a bad value, tell the same.
  std::vector<Rgb<float>> given = x.quarter;
  for (Rgb<float>& quarter : given)
    for (Plane<float>& plane : quarter.channel)
      for (size_t i = 0; i < plane.size(); ++i) plane[i] /= 1024;
  given[2][0][firefly] = std::numeric_limits<float>::quiet_NaN();
  const std::vector<Firefly> scaled = findFireflies(x, {&given, 1024}, nullptr);
  REQUIRE(scaled.size() == 1);
  CHECK(scaled[0].index == firefly);
  CHECK(findFireflies(x, {&given, 1}, nullptr).size() == 2);  // the lamp's quarters seem dark
}

TEST_CASE("Without quarters the halves tell fireflies, and without halves nothing does") {
  Estimate x = flat(1.0f, 1e-4f);
  const size_t firefly = x.mean[0].index(10, 10), lamp = x.mean[0].index(30, 20);
  setPixel(x, firefly, 50, {197, 1, 1, 1}, 2400);
  setPixel(x, lamp, 50, {49, 51, 50, 50}, 2400);
  x.quarter.clear();
  const std::vector<Firefly> fireflies = findFireflies(x, {&x.quarter}, nullptr);
  REQUIRE(fireflies.size() == 1);
  CHECK(fireflies[0].index == firefly);
  const Estimate clean = withoutFireflies(x, {}, nullptr);
  for (const Rgb<float>* image : {&clean.mean, &clean.half[0], &clean.half[1]}) {
    CHECK((*image)[1][firefly] == doctest::Approx(1.0));
    CHECK((*image)[1][lamp] > 40.0f);
  }
  CHECK(clean.variance[1][firefly] == doctest::Approx(1e-4));
  x.half[0] = x.half[1] = {};
  CHECK(findFireflies(x, {}, nullptr).empty());
}

TEST_CASE("Fireflies that share a neighbourhood are its light and keep most of it") {
  const auto features = [](float albedoOfFireflies) {
    Features f;
    for (FeaturePlanes<Rgb<float>>* planes : {&f.albedo, &f.normal}) {
      planes->mean = Rgb<float>(40, 30, 0.5f);
      planes->half[0] = planes->half[1] = planes->mean;
    }
    for (size_t i = 0; i < f.albedo.mean.size(); i += 7)
      for (size_t c = 0; c < 3; ++c) f.albedo.mean[c][i] = albedoOfFireflies;
    return f;
  };
  Estimate x = flat(1.0f, 1e-4f);
  std::vector<size_t> places;  // far enough apart to stand out
  for (int y = 5; y < 30; y += 7)
    for (int u = 0; u < 40; u += 7) places.push_back(x.mean[0].index(u, y) / 7 * 7);
  for (const size_t i : places) setPixel(x, i, 51, {201, 1, 1, 1}, 2500);
  const Features alike = features(0.5f), lamps = features(3.0f);
  const std::vector<Firefly> fireflies = findFireflies(x, {&x.quarter}, &alike);
  REQUIRE(fireflies.size() == places.size());
  Rgb<float> image = x.mean, variance = x.variance;
  replaceValues(image, fireflies);
  replaceVariances(variance, fireflies);
  for (const Firefly& f : fireflies) {
    // Within 20 pixels lie about 41² / 49 of them, mirrored ones counted again.
    CHECK(f.kept > 1 - 12.0 / 25);
    CHECK(f.kept < 1 - 12.0 / 45);
    CHECK(f.keptByJudge == doctest::Approx(1 - (1 - f.kept) * 3 / 12));
    CHECK(image[0][f.index] == doctest::Approx(1 + 50 * f.kept));
    CHECK(variance[0][f.index] == doctest::Approx(1e-4 + f.kept * (2500 - 1e-4)));
  }
  // One alone is noise; pixels of another surface may be lamps; without features nobody knows.
  for (const size_t i : places)
    if (i != places[8]) setPixel(x, i, 1, {1, 1, 1, 1}, 1e-4f);
  REQUIRE(findFireflies(x, {&x.quarter}, &alike).size() == 1);
  CHECK(findFireflies(x, {&x.quarter}, &alike)[0].kept == 0);
  for (const size_t i : places) setPixel(x, i, 51, {201, 1, 1, 1}, 2500);
  for (const Firefly& f : findFireflies(x, {&x.quarter}, &lamps)) CHECK(f.kept == 0);
  for (const Firefly& f : findFireflies(x, {&x.quarter}, nullptr)) CHECK(f.kept == 0);
}

TEST_CASE("What images are judged by and what is filtered are exchanged, and exchanged back") {
  Estimate x = flat(1.0f, 1e-4f);
  const size_t at = x.mean[0].index(10, 10);
  setPixel(x, at, 51, {201, 1, 1, 1}, 2500);
  Firefly firefly{at, Spectrum(1), Spectrum(1e-4f)};
  firefly.keptByJudge = 0.5f;
  const std::vector<PixelValues> before = removePixels(x, {firefly});
  std::vector<PixelValues> judging = judgingPixels(before, {firefly});
  CHECK(x.mean[1][at] == 1);
  swapPixels(x, judging);
  CHECK(x.mean[1][at] == doctest::Approx(26));
  CHECK(x.half[0][1][at] == doctest::Approx(1 + 0.5 * (before[0].half[0][1] - 1)));
  CHECK(x.variance[1][at] == doctest::Approx(1250));
  swapPixels(x, judging);
  CHECK(x.mean[1][at] == 1);
  CHECK(x.variance[1][at] == doctest::Approx(1e-4));
}

TEST_CASE("A firefly in one quarter leaves nothing in its neighbours either") {
  // Noise of 0.03 around 1, and one pixel of 220 in one quarter.
  Estimate x = flat(1.0f, 0);
  std::mt19937 random(5);
  std::normal_distribution<float> normal(1.0f, 0.06f);
  for (size_t i = 0; i < x.mean.size(); ++i) {
    std::array<float, 4> quarters{};
    for (float& q : quarters) q = normal(random);
    setPixel(x, i, (quarters[0] + quarters[1] + quarters[2] + quarters[3]) / 4, quarters, 9e-4f);
  }
  setPixel(x, x.mean[0].index(20, 15), 220, {877, 1, 1, 1}, 4.84e4f);
  x.name = "pt";
  Estimates e;
  e.width = 40;
  e.height = 30;
  e.estimates.push_back(x);
  const auto largest = [&](const char* method, const PipelineOptions& options) {
    const Rgb<float> image = outputOf(e, method, options).result.image.mean;
    return *std::max_element(image[0].data.begin(), image[0].data.end());
  };
  CHECK(largest("auto", {}) < 1.1f);
  // Nor where it is kept, for the weights see which images hold it; shrinkage by itself lets it in.
  PipelineOptions kept;
  kept.numbers.set("auto-remove-fireflies", 0);
  CHECK(largest("auto", kept) < 1.1f);
  kept.numbers.set("js-gate", 0);
  CHECK(largest("js@pw-wide", kept) > 1.4f);
}

TEST_CASE("Fireflies are replaced in place where that is allowed, and nowhere else, with the same bits") {
  Case c = noisyCase(64);
  Estimate& x = *std::find_if(c.estimates.estimates.begin(), c.estimates.estimates.end(),
                              [](const Estimate& e) { return e.name == "pt"; });
  const size_t at = x.mean[0].index(40, 30);
  for (size_t channel = 0; channel < 3; ++channel) {
    x.mean[channel][at] += 50;
    x.half[0][channel][at] += 100;
    x.quarter[0][channel][at] += 200;
    x.variance[channel][at] += 2500;
  }
  const auto method = findMethod("auto");
  MethodInputs in;
  in.unbiased = &x;
  in.features = &*c.estimates.features;
  in.quarters = {&x.quarter};
  const Estimate before = x;
  const MethodResult copied = method->run(in);
  CHECK(identical(x.mean, before.mean));
  CHECK(identical(x.variance, before.variance));
  in.consumable = &x;
  const MethodResult inPlace = method->run(in);
  CHECK(x.mean[0][at] < 25);
  CHECK(identical(copied.image.mean, inPlace.image.mean));
  CHECK(identical(copied.error, inPlace.error));
}

TEST_CASE("The rim of a lamp, darker than the lamp and noisier than all around it, stays as it is") {
  // The lamp's pixels are brighter, without noise and of another surface than the rim and the wall.
  Estimate x = flat(0.5f, 1e-8f);
  Features features;
  for (FeaturePlanes<Rgb<float>>* f : {&features.albedo, &features.normal}) {
    f->mean = Rgb<float>(40, 30, 0.0f);
    f->half[0] = f->half[1] = f->mean;
  }
  for (int y = 10; y < 20; ++y)
    for (int u = 10; u < 20; ++u) {
      const size_t i = x.mean[0].index(u, y);
      const bool rim = u == 10 || u == 19 || y == 10 || y == 19;
      const float value = rim ? 0.9f : 1.4f;
      setPixel(x, i, value, {value - 0.005f, value + 0.005f, value, value}, rim && (u + y) % 7 == 0 ? 2e-5f : 1e-8f);
      for (size_t c = 0; c < 3; ++c) features.albedo.mean[c][i] = rim ? 0.5f : 1.0f;
    }
  CHECK(findFireflies(x, {&x.quarter}, &features).empty());
}

}  // namespace braid::test_auto_fireflies
