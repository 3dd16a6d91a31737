// SPDX-License-Identifier: Apache-2.0
// Lamps of a pixel or less, 30,000 times as bright as what is around them: no filter may smear them, for that is an
// error of 10⁸ in relL2.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <doctest/doctest.h>

#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_small_lamps {

using namespace test;

namespace {

constexpr int kWidth = 48, kHeight = 36;
constexpr double kDark = 0.01, kLamp = 350, kCoverage = 0.9;

// Lamps that cover nine tenths of a pixel or less, at even and odd positions as strided models see them.
const std::pair<int, int> kLamps[] = {{10, 10}, {31, 9}, {12, 25}, {33, 26}};

bool isLamp(int x, int y) {
  for (const auto& [u, v] : kLamps)
    if (x == u && y == v) return true;
  return false;
}

// A dark wall with lamps, and features that know nothing of the lamps.
Estimates lampsOnWall(uint64_t samples, uint64_t seed, double coverage = kCoverage) {
  CaseOptions o;
  o.width = kWidth;
  o.height = kHeight;
  o.samples = samples;
  o.seed = seed;
  Estimates e = makeCase(o).estimates;
  e.estimates = {detail::estimateOfSamples("pt", o, [&](uint64_t pass, size_t i, size_t channel) {
    const double u = detail::uniform(seed, 5, pass, 3 * static_cast<uint64_t>(i) + channel);
    const double covered = detail::uniform(seed, 6, pass, static_cast<uint64_t>(i));
    const bool lamp = isLamp(static_cast<int>(i) % kWidth, static_cast<int>(i) / kWidth) && covered < coverage;
    return lamp ? kLamp : kDark * detail::factor(std::max(u, 1e-12), 0.5);
  })};
  e.history.clear();
  return e;
}

// A dark wall of even noise, on which a single sample of one pixel is the lamp.
Estimates fireflyOnWall(uint64_t samples, uint64_t seed) {
  Estimates e = lampsOnWall(samples, seed, 0);
  CaseOptions o;
  o.width = kWidth;
  o.height = kHeight;
  o.samples = samples;
  o.seed = seed;
  e.estimates = {detail::estimateOfSamples("pt", o, [&](uint64_t pass, size_t i, size_t channel) {
    const double u = detail::uniform(seed, 5, pass, 3 * static_cast<uint64_t>(i) + channel);
    const bool lamp = i == static_cast<size_t>(kLamps[1].second * kWidth + kLamps[1].first) && pass == samples / 3;
    return lamp ? kLamp : kDark * detail::factor(std::max(u, 1e-12), 0.5);
  })};
  return e;
}

double brightestOf(const Rgb<float>& image) {
  return static_cast<double>(*std::max_element(image[0].data.begin(), image[0].data.end()));
}

}  // namespace

TEST_CASE("No denoiser lights what is beside a small lamp by the lamp") {
  for (const uint64_t samples : {32u, 128u})
    for (uint64_t seed = 1; seed < 4; ++seed) {
      const Estimates e = lampsOnWall(samples, seed);
      for (const std::string name : {"pw", "pw-wide", "pw1", "nlm", "nfor", "rdfc", "ensemble@nfor+rdfc", "auto"}) {
        const PipelineResult r = runPipeline(e, {name}, {});
        REQUIRE(r.find(name)->ran());
        const Rgb<float>& image = r.find(name)->result.image.mean;
        CAPTURE(name);
        for (int y = 0; y < kHeight; ++y)
          for (int x = 0; x < kWidth; ++x)
            if (!isLamp(x, y)) CHECK(static_cast<double>(image[0].at(x, y)) < 3 * kDark);
        for (const auto& [x, y] : kLamps) CHECK(static_cast<double>(image[0].at(x, y)) > 0.5 * kCoverage * kLamp);
      }
    }
}

// With 8 samples, a lamp that half of them see is still 2.6 standard deviations above nothing.
TEST_CASE("Few samples of a lamp that covers half of its pixel do not light what is beside it either") {
  for (uint64_t seed = 1; seed < 6; ++seed) {
    const Estimates e = lampsOnWall(8, seed, 0.5);
    for (const std::string name : {"nfor", "rdfc", "ensemble@nfor+rdfc"}) {
      const PipelineResult r = runPipeline(e, {name}, {});
      REQUIRE(r.find(name)->ran());
      CAPTURE(name);
      CAPTURE(seed);
      for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x)
          if (!isLamp(x, y)) CHECK(static_cast<double>(r.find(name)->result.image.mean[0].at(x, y)) < 6 * kDark);
    }
  }
}

TEST_CASE("A firefly of one sample is gone from what is filtered, with quarters and without, unless it is to be kept") {
  for (const uint64_t samples : {8u, 128u})
    for (const bool quarters : {true, false}) {
      Estimates e = fireflyOnWall(samples, 3);
      if (!quarters) e.estimates[0].quarter.clear();
      for (const std::string name : {"nfor", "rdfc"}) {
        CAPTURE(name);
        CAPTURE(samples);
        CAPTURE(quarters);
        const auto brightest = [&](double removeFireflies) {
          PipelineOptions options;
          options.numbers.set(name + "-remove-fireflies", removeFireflies);
          const PipelineResult r = runPipeline(e, {name}, options);
          REQUIRE(r.find(name)->ran());
          const Estimate& image = r.find(name)->result.image;
          return std::max({brightestOf(image.mean), brightestOf(image.half[0]), brightestOf(image.half[1])});
        };
        CHECK(brightest(1) < 3 * kDark);
        CHECK(brightest(0) > 10 * kDark);
      }
    }
}

}  // namespace braid::test_small_lamps
