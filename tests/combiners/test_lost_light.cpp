// SPDX-License-Identifier: Apache-2.0
// Light that filters have lost, given back: where it is the light of the surroundings, and nowhere else.
#include <cmath>
#include <limits>
#include <random>

#include <doctest/doctest.h>

#include "combiners/auto/lost_light.h"
#include "combiners/pixels/likeness.h"
#include "tests/combiners/auto_cases.h"

namespace braid::test_lost_light {

using namespace test;
using namespace test::auto_cases;

namespace {

constexpr int kWidth = 200, kHeight = 150;

// A wall of 1. Half of its light are bright samples at random places, each in one half.
Estimate wallBySamples(int samples, bool inBothHalves = false) {
  Estimate x = flat(0.5f, 1e-6f, kWidth, kHeight);
  std::mt19937 random(7);
  std::uniform_int_distribution<size_t> anywhere(0, x.mean.size() - 1);
  const float value = 0.5f * static_cast<float>(x.mean.size()) / static_cast<float>(samples);
  for (int k = 0; k < samples; ++k) {
    const size_t i = anywhere(random);
    for (size_t c = 0; c < 3; ++c) {
      x.mean[c][i] += value;
      if (inBothHalves) {
        for (Rgb<float>& half : x.half) half[c][i] += value;
      } else {
        x.half[static_cast<size_t>(k) % 2][c][i] += 2 * value;
        x.variance[c][i] = value * value;
      }
    }
  }
  return x;
}

Estimate darkWall() { return flat(0.5f, 1e-6f, kWidth, kHeight); }

double meanOfImage(const Rgb<float>& image) {
  double sum = 0;
  for (size_t i = 0; i < image.size(); ++i) sum += static_cast<double>(image[1][i]);
  return sum / static_cast<double>(image.size());
}

Features evenFeatures() {
  Features f;
  for (FeaturePlanes<Rgb<float>>* planes : {&f.albedo, &f.normal}) {
    planes->mean = Rgb<float>(kWidth, kHeight, 0.5f);
    planes->half[0] = planes->half[1] = planes->mean;
  }
  return f;
}

}  // namespace

TEST_CASE("Light of many bright samples is given back to the image and to its halves") {
  const Features features = evenFeatures();
  for (const Features* f : {static_cast<const Features*>(nullptr), &features}) {
    const auto out = withLostLight(darkWall(), wallBySamples(1200), f);
    REQUIRE(out);
    CHECK(meanOfImage(out->mean) == doctest::Approx(1).epsilon(0.06));
    for (const Rgb<float>& half : out->half) CHECK(meanOfImage(half) == doctest::Approx(1).epsilon(0.1));
    // As smooth as it was.
    for (size_t i = 1; i < out->mean.size(); ++i)
      if (i % kWidth != 0) CHECK(std::fabs(out->mean[0][i] - out->mean[0][i - 1]) < 0.02f);
  }
}

TEST_CASE("A few bright samples, lamps and what lies on other surfaces give nothing back") {
  CHECK_FALSE(withLostLight(darkWall(), wallBySamples(9), nullptr));
  CHECK_FALSE(withLostLight(darkWall(), wallBySamples(1200, true), nullptr));  // lamps: both halves show them
  CHECK_FALSE(withLostLight(darkWall(), darkWall(), nullptr));
  Features unlike = evenFeatures();
  const Estimate x = wallBySamples(1200);
  for (size_t i = 0; i < x.mean.size(); ++i)
    if (x.mean[0][i] > 1)
      for (size_t c = 0; c < 3; ++c) unlike.albedo.mean[c][i] = 3;
  CHECK_FALSE(withLostLight(darkWall(), x, &unlike));
  // What is brighter than the samples stays so.
  CHECK_FALSE(withLostLight(flat(2, 1e-6f, kWidth, kHeight), x, nullptr));
}

TEST_CASE("Lost light of extreme images is finite, and at most four times what is there") {
  for (const float scale : {0.0f, 1e-30f, 1e-6f, 1e6f, 1e30f, 3e38f}) {
    Estimate x = wallBySamples(1200), image = darkWall();
    for (Rgb<float>* values :
         {&x.mean, &x.half[0], &x.half[1], &x.variance, &image.mean, &image.half[0], &image.half[1]})
      for (size_t c = 0; c < 3; ++c)
        for (size_t i = 0; i < values->size(); ++i)
          (*values)[c][i] = std::min((*values)[c][i] * scale, std::numeric_limits<float>::max());
    const auto out = withLostLight(image, x, nullptr);
    if (!out) continue;
    for (size_t i = 0; i < out->mean.size(); ++i) {
      CHECK(std::isfinite(out->mean[0][i]));
      CHECK(out->mean[0][i] <= 4.001f * std::min(image.mean[0][i], 8e37f));
    }
  }
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(3, 200)})
    CHECK_FALSE(withLostLight(flat(1, 1, width, height), flat(1, 1, width, height), nullptr));
}

TEST_CASE("Alike pixels are those whose neighbours have their albedo and normal") {
  Features features = evenFeatures();
  const size_t lamp = features.albedo.mean[0].index(50, 40);
  features.albedo.mean[1][lamp] = 2;
  CHECK_FALSE(isAlike(features, 50, 40));
  CHECK(isAlike(features, 51, 40));
  CHECK(isAlike(features, 0, 0));
  CHECK(unlikeness(features, lamp, lamp) == 0);
  CHECK(unlikeness(features, lamp, lamp + 1) == doctest::Approx(1.5 * 1.5 / (2 * 0.25 * 0.25)));
}

TEST_CASE("auto gives light back, and leaves it with --auto-lost-light 0") {
  Estimate x = wallBySamples(1200);
  x.name = "pt";
  x.passes = 4;
  Estimates e;
  e.width = kWidth;
  e.height = kHeight;
  e.estimates.push_back(x);
  e.features = evenFeatures();
  PipelineOptions without;
  without.numbers.set("auto-lost-light", 0);
  const double before = meanOfImage(outputOf(e, "auto", without).result.image.mean);
  const PipelineOutput out = outputOf(e, "auto");
  MESSAGE("mean of 1: ", before, " without, ", meanOfImage(out.result.image.mean));
  CHECK(before < 0.9);
  CHECK(meanOfImage(out.result.image.mean) == doctest::Approx(1).epsilon(0.08));
  Plane<float> sum(kWidth, kHeight, 0.0f);
  for (const NamedPlane& map : out.result.aovs)
    if (map.name.starts_with("weight.auto."))
      for (size_t i = 0; i < sum.size(); ++i) sum[i] += map.plane[i];
  for (size_t i = 0; i < sum.size(); i += 97) CHECK(sum[i] == doctest::Approx(1).epsilon(1e-3));
}

}  // namespace braid::test_lost_light
