// SPDX-License-Identifier: Apache-2.0
// Which pixels count as lone fireflies: those that one sample carries, not those of a glossy reflection; and what
// shrinkage towards a filter makes of such a reflection.
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include "combiners/pipeline/registry.h"
#include "combiners/shrinkage/shrinkage.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_lone_fireflies {

namespace {

constexpr int kWidth = 96, kHeight = 72;

// Lamps mirrored by a glossy plate every 24 pixels: spots of two pixels in radius on black.
double reflection(int x, int y) {
  const double dx = x % 24 - 12, dy = y % 24 - 12;
  return 0.02 + 2 * std::exp(-(dx * dx + dy * dy) / (2 * 2.0 * 2.0));
}

// A picture with noise in proportion to its brightness.
Estimate noisy(double (*picture)(int, int), double relativeDeviation, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Estimate e;
  e.passes = 512;
  e.mean = e.half[0] = e.half[1] = e.variance = Rgb<float>(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const double value = picture(x, y), deviation = relativeDeviation * value;
      const double noise[2] = {normal(random), normal(random)};
      for (size_t c = 0; c < 3; ++c) {
        for (size_t h = 0; h < 2; ++h)
          e.half[h][c].at(x, y) = static_cast<float>(value + std::sqrt(2.0) * deviation * noise[h]);
        e.mean[c].at(x, y) = 0.5f * (e.half[0][c].at(x, y) + e.half[1][c].at(x, y));
        e.variance[c].at(x, y) = static_cast<float>(deviation * deviation);
      }
    }
  return e;
}

// Sums of squared errors and of relative ones.
struct Errors {
  double square = 0, relative = 0;
};

Errors errorsOf(const Rgb<float>& image) {
  Errors sum;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const double truth = reflection(x, y), d = static_cast<double>(image[0].at(x, y)) - truth;
      sum.square += d * d;
      sum.relative += d * d / (truth * truth + 0.01);
    }
  return sum;
}

Estimate boxOf(const Estimate& x) {
  Estimate box;
  box.name = "box";
  box.unbiased = false;
  box.passes = x.passes;
  box.mean = test::detail::boxFilter(x.mean, 7);
  for (size_t h = 0; h < 2; ++h) box.half[h] = test::detail::boxFilter(x.half[h], 7);
  return box;
}

MethodResult shrunkTowards(const Estimate& y, const Estimate& x) {
  MethodInputs in;
  in.unbiased = &x;
  in.biased = &y;
  return make_js()->run(in);
}

}  // namespace

TEST_CASE("A pixel that one sample carries is a lone firefly where the other image is right around it") {
  Rgb<float> x(kWidth, kHeight, 1.0f), variance(kWidth, kHeight, 1e-4f), y(kWidth, kHeight, 1.01f);
  const size_t firefly = x[0].index(40, 30), edge = x[0].index(0, 0);
  for (const size_t i : {firefly, edge})
    for (size_t c = 0; c < 3; ++c) {
      x[c][i] = 3;
      variance[c][i] = 4;
    }
  const Plane<float> gate = fireflyGate(variance, kGateRadius);
  for (size_t i = 0; i < gate.size(); ++i) CHECK(isLoneFirefly(gate, x, y, i) == (i == firefly || i == edge));
  // An image that is off by more than the firefly deviates is no better.
  const Rgb<float> wrong(kWidth, kHeight, 3.5f);
  CHECK_FALSE(isLoneFirefly(gate, x, wrong, firefly));
  CHECK_FALSE(isLoneFirefly(Plane<float>(), x, y, firefly));
}

TEST_CASE("Fireflies side by side do not speak for each other") {
  Rgb<float> x(kWidth, kHeight, 1.0f), variance(kWidth, kHeight, 1e-4f);
  const Rgb<float> y(kWidth, kHeight, 1.0f);
  const size_t first = x[0].index(40, 30);
  for (const size_t i : {first, first + 1, first + 2 * kWidth})
    for (size_t c = 0; c < 3; ++c) {
      x[c][i] = 21;
      variance[c][i] = 200;
    }
  const Plane<float> gate = fireflyGate(variance, kGateRadius);
  for (const size_t i : {first, first + 1, first + 2 * kWidth}) CHECK(isLoneFirefly(gate, x, y, i));
}

TEST_CASE("A glossy reflection is not replaced by what a filter has made of it") {
  // Its pixels deviate by 16 to 40 %, far more than the black around them, and by less than three deviations from
  // the filter: shrinkage towards a box must not be worse than what it shrinks.
  for (const double deviation : {0.16, 0.25, 0.4}) {
    const Estimate x = noisy(reflection, deviation, 1);
    CAPTURE(deviation);
    CHECK(errorsOf(shrunkTowards(boxOf(x), x).image.mean).square < 1.02 * errorsOf(x.mean).square);
  }
}

TEST_CASE("What is told of the error beside a bright reflection is in proportion to the image, not to the filter's") {
  const Estimate x = noisy(reflection, 0.2, 2);
  const MethodResult result = shrunkTowards(boxOf(x), x);
  double told = 0;
  for (size_t i = 0; i < result.error.size(); ++i)
    told += static_cast<double>(result.error[i]) / (sqr(static_cast<double>(result.image.mean[0][i])) + 0.01);
  const double truth = errorsOf(result.image.mean).relative;
  CHECK(told > 0.5 * truth);
  CHECK(told < 2 * truth);
}

TEST_CASE("A mirror image one pixel wide is not replaced by what a filter has made of it") {
  const auto mirrorImage = [](int x, int y) { return x == 40 && y > 20 && y < 30 ? 30.0 : 0.05; };
  const Estimate x = noisy(mirrorImage, 0.4, 5);
  const Estimate box = boxOf(x);
  const Rgb<float> image = shrunkTowards(box, x).image.mean;
  const Plane<float> gate = fireflyGate(x.variance, kGateRadius);
  int fireflies = 0;
  double kept = 0, replaced = 0;
  for (int v = 21; v < 30; ++v) {
    fireflies += isLoneFirefly(gate, x.mean, box.mean, gate.index(40, v)) ? 1 : 0;
    kept += std::pow(static_cast<double>(image[0].at(40, v)) - 30, 2);
    replaced += std::pow(static_cast<double>(box.mean[0].at(40, v)) - 30, 2);
  }
  CHECK(fireflies >= 4);  // else this tests nothing
  CHECK(kept < 0.5 * replaced);
}

}  // namespace braid::test_lone_fireflies
