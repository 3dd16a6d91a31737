// SPDX-License-Identifier: Apache-2.0
// Uncorrelated weighting beside lamps and fireflies: which pairs are left out, what is shared out, and that no light is
// lost.
#include <optional>

#include <doctest/doctest.h>

#include "combiners/uncorrelated/uncorrelated_filter.h"
#include "combiners/uncorrelated/uncorrelated_noise.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_uncorrelated_lamps {

using namespace test;

TEST_CASE("Pairs with a lamp are left out, those with a rare strong sample are not, and no light is lost") {
  constexpr int kSize = 31, kLamp = 15;
  const Rgb<float> z(kSize, kSize, 0.1f), nothing(kSize, kSize, 0.0f);
  Rgb<float> y = z;
  for (size_t c = 0; c < 3; ++c) y[c].at(kLamp, kLamp) += 5;
  const auto filtered = [&](float varianceOfLamp, double most) {
    Rgb<float> variance(kSize, kSize, 1e-4f);
    for (size_t c = 0; c < 3; ++c) variance[c].at(kLamp, kLamp) = varianceOfLamp;
    const Rgb<float> levels = noiseLevels(y, variance);
    return uncorrelatedFiltered({&y, &z, &nothing, &nothing, 16, &levels, most}, 0.5);
  };
  const Rgb<float> paper = uncorrelatedFiltered({&y, &z, &nothing, &nothing, 16}, 0.5);
  const Rgb<float> lamp = filtered(1, 30), rare = filtered(25, 30), anyNoise = filtered(1, 1e30);
  CHECK(identical(rare, paper));
  CHECK(identical(anyNoise, paper));
  for (size_t c = 0; c < 3; ++c) {
    CHECK(paper[c].at(kLamp + 3, kLamp) - 0.1f > 0.02f);
    CHECK(lamp[c].at(kLamp + 3, kLamp) == doctest::Approx(0.1));
    CHECK(lamp[c].at(kLamp, kLamp) == doctest::Approx(5.1));
    for (const Rgb<float>* out : {&paper, &lamp}) {
      double before = 0, after = 0;
      for (size_t i = 0; i < y.size(); ++i) {
        before += static_cast<double>(y[c][i]);
        after += static_cast<double>((*out)[c][i]);
      }
      CHECK(after == doctest::Approx(before).epsilon(1e-5));
    }
  }
}

// One strong sample each, as far as their own statistics tell; but rare ones do not meet.
TEST_CASE("Strong samples of neighbours are a lamp: theirs is the noise of the place") {
  constexpr int kSize = 31, kLamp = 15;
  const Rgb<float> z(kSize, kSize, 0.1f), nothing(kSize, kSize, 0.0f);
  const auto levelsOf = [&](int side, Rgb<float>& out) {
    Rgb<float> y = z, variance(kSize, kSize, 1e-4f);
    for (size_t c = 0; c < 3; ++c)
      for (int v = kLamp; v < kLamp + side; ++v)
        for (int u = kLamp; u < kLamp + side; ++u) {
          y[c].at(u, v) += 5;
          variance[c].at(u, v) = u == kLamp ? 25 : 4;  // of samples as different as 1 to 2.5
        }
    const Rgb<float> levels = noiseLevels(y, variance);
    out = uncorrelatedFiltered({&y, &z, &nothing, &nothing, 16, &levels, 30}, 0.5);
    return levels;
  };
  Rgb<float> lone, lamp;
  const Rgb<float> ofLone = levelsOf(1, lone), ofLamp = levelsOf(2, lamp);
  for (size_t c = 0; c < 3; ++c) {
    CHECK(ofLone[c].at(kLamp, kLamp) < 0.01f);
    CHECK(ofLamp[c].at(kLamp, kLamp) == 25);
    CHECK(ofLamp[c].at(kLamp + 1, kLamp + 1) == 4);
    CHECK(lone[c].at(kLamp + 4, kLamp) - 0.1f > 0.02f);
    CHECK(lamp[c].at(kLamp + 4, kLamp) == doctest::Approx(0.1));
  }
}

TEST_CASE("A lamp that only the correlated image has met does not darken its surroundings") {
  constexpr int kSize = 31, kLamp = 15;
  const Rgb<float> nothing(kSize, kSize, 0.0f);
  Estimate y;
  y.mean = Rgb<float>(kSize, kSize, 0.1f);
  y.variance = Rgb<float>(kSize, kSize, 1e-4f);
  Estimate z = y;
  for (size_t c = 0; c < 3; ++c) z.mean[c].at(kLamp, kLamp) += 5, z.variance[c].at(kLamp, kLamp) = 1;
  const auto filtered = [&](const Rgb<float>& levels) {
    return uncorrelatedFiltered({&y.mean, &z.mean, &nothing, &nothing, 16, &levels, 30}, 0.5);
  };
  const Rgb<float> ofOne = filtered(noiseLevels(y.mean, y.variance)), ofBoth = filtered(differenceNoiseLevels(y, z));
  for (size_t c = 0; c < 3; ++c) {
    CHECK(ofOne[c].at(kLamp + 3, kLamp) < 0.1f - 0.02f);
    CHECK(ofBoth[c].at(kLamp + 3, kLamp) == doctest::Approx(0.1));
    CHECK(ofBoth[c].at(kLamp, kLamp) == doctest::Approx(0.1));
  }
  Estimate unknown = z;
  unknown.variance = Rgb<float>();
  CHECK(identical(differenceNoiseLevels(y, unknown), noiseLevels(y.mean, y.variance)));
  CHECK(differenceNoiseLevels(unknown, unknown).empty());
}

TEST_CASE("Fireflies that the other image knows nothing of are shared out, and no light is lost") {
  for (const auto& [width, height] : {std::array{90, 70}, {7, 3}}) {
    CAPTURE(width);
    Estimate y;
    y.mean = y.half[0] = y.half[1] = Rgb<float>(width, height, 0.1f);
    y.variance = Rgb<float>(width, height, 1e-4f);
    y.quarter.assign(4, y.mean);
    const Rgb<float> z(width, height, 0.12f);
    CHECK_FALSE(takeFirefliesOut(y, z));
    // One in the last quarter, at a corner, of green alone.
    y.mean[1].at(0, 0) += 50;
    y.half[1][1].at(0, 0) += 100;
    y.quarter[3][1].at(0, 0) += 200;
    y.variance[1].at(0, 0) = 2500;
    Rgb<float> aware = z;
    aware[1].at(0, 0) = 6;
    CHECK_FALSE(takeFirefliesOut(y, aware));
    const std::optional<SharedOut> out = takeFirefliesOut(y, z);
    REQUIRE(out);
    CHECK(identical(out->image.mean[0], y.mean[0]));
    CHECK(out->image.variance[1].at(0, 0) < 0.01f);
    for (const Rgb<float>& quarter : out->image.quarter) CHECK(quarter[1].at(0, 0) == z[1].at(0, 0));
    const int columns = std::min(32, width), rows = std::min(32, height);
    const auto check = [&](const Plane<float>& image, const Plane<float>& shares, double sample) {
      CHECK(image.at(0, 0) == z[1].at(0, 0));
      CHECK(image.at(1, 0) == 0.1f);
      double sum = 0;
      for (const float v : shares.data) sum += static_cast<double>(v);
      CHECK(sum == doctest::Approx(sample - 0.02).epsilon(1e-4));
      CHECK(static_cast<double>(shares.at(columns - 1, rows - 1)) ==
            doctest::Approx((sample - 0.02) / (columns * rows)).epsilon(1e-4));
      if (width > columns) CHECK(shares.at(columns, 0) == 0.0f);
    };
    check(out->image.mean[1], out->mean[1], 50);
    check(out->image.half[0][1], out->half[0][1], 0);
    check(out->image.half[1][1], out->half[1][1], 100);
  }
}

TEST_CASE("What several samples make, or neighbours, is no lone sample") {
  Estimate y;
  y.mean = y.half[0] = y.half[1] = Rgb<float>(40, 40, 0.1f);
  y.variance = Rgb<float>(40, 40, 1e-4f);
  const Rgb<float> z = y.mean;
  y.mean[0].at(20, 20) = 50;
  y.variance[0].at(20, 20) = 833;  // of three equal samples of many
  CHECK_FALSE(takeFirefliesOut(y, z));
  y.variance[0].at(20, 20) = 1250;  // of two
  CHECK(takeFirefliesOut(y, z));
  // Three neighbours with a sixteenth of its variance, themselves of means that count.
  for (const auto& [u, v] : {std::pair{19, 20}, {21, 20}, {20, 21}}) {
    CHECK(takeFirefliesOut(y, z));
    y.mean[0].at(u, v) = 20;
    y.variance[0].at(u, v) = 80;
  }
  CHECK_FALSE(takeFirefliesOut(y, z));
}

}  // namespace braid::test_uncorrelated_lamps
