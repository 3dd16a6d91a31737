// SPDX-License-Identifier: Apache-2.0
// Fused estimates of "auto": weights, and the errors that are left.
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include "combiners/statistics/half_statistics.h"
#include "combiners/shrinkage/fused_estimate.h"
#include "tests/combiners/auto_cases.h"

namespace braid::test_auto_fused {

using namespace test;
using namespace test::auto_cases;

TEST_CASE("Fused weights are inverse errors, with squared biases counted twice, and the bias that is left is told") {
  Estimate x = flat(1.0f, 0.03f), s = flat(1.0f, 0.005f);
  s.name = "sppm";
  s.unbiased = false;
  const float bias = std::sqrt(0.005f);
  s.mean = s.half[0] = s.half[1] = Rgb<float>(40, 30, 1 - bias);
  s.quarter.assign(4, s.mean);
  s.bias = Rgb<float>(40, 30, bias);
  s.biasVariance = Rgb<float>(40, 30);
  const FusedEstimate f = fusedEstimate(x, {&s}, nullptr);
  // Errors 0.03 and 0.005 + 2 · 0.005: weights 1/3 and 2/3.
  CHECK(f.image.mean[0][500] == doctest::Approx(1 - bias * 2 / 3).epsilon(1e-3));
  CHECK(f.image.quarter[2][1][500] == doctest::Approx(1 - bias * 2 / 3).epsilon(1e-3));
  CHECK(f.image.variance[0][500] == doctest::Approx((0.03 + 4 * 0.015) / 9).epsilon(1e-3));
  CHECK(f.squaredBias[500] == doctest::Approx(4 * 2 * 0.005 / 9).epsilon(1e-3));
}

TEST_CASE("A photon map without bias leaves none in the error, however noisy its estimate of it is") {
  const int width = 120, height = 90;
  Estimate x = flat(1.0f, 1e-3f, width, height), s = flat(1.0f, 1e-3f, width, height);
  std::mt19937 random(1);
  std::normal_distribution<float> normal(0, 0.05f);
  s.bias = Rgb<float>(width, height);
  s.biasVariance = Rgb<float>(width, height, sqr(0.05f));
  for (Plane<float>& plane : s.bias.channel)
    for (float& b : plane.data) b = normal(random);
  const FusedEstimate f = fusedEstimate(x, {&s}, nullptr);
  const double pixels = width * height;
  double mean = 0, square = 0, claimed = 0;
  for (size_t i = 0; i < f.squaredBias.size(); ++i) {
    const auto sample = static_cast<double>(f.squaredBias[i]);
    mean += sample / pixels;
    square += sample * sample / pixels;
    claimed += static_cast<double>(f.image.variance[0][i] - f.noise[0][i]) / pixels;
  }
  CHECK(std::fabs(mean) < 4 * std::sqrt(square / pixels));  // one false alarm in 16,000 seeds
  CHECK(claimed > 0);                                       // weights and filters count on the worst
  CHECK(relativeSum(smoothedSquaredBias(f.squaredBias, x.mean), x.mean) < 0.1 * sqr(0.05));
  // A bias, on the other hand, is found.
  for (Plane<float>& plane : s.bias.channel)
    for (float& b : plane.data) b += 0.2f;
  const FusedEstimate biased = fusedEstimate(x, {&s}, nullptr);
  const double share = 1 - (0.001 + 0.04) / (0.001 + 0.001 + 0.04);  // of the photon map, by inverse errors
  CHECK(relativeSum(smoothedSquaredBias(biased.squaredBias, x.mean), x.mean) ==
        doctest::Approx(sqr(share) * 0.04 / 1.01).epsilon(0.1));
}

TEST_CASE("Squared errors that halves show are those of half the samples, relative to brightness and noise") {
  // Halves of x deviate by +-s, so that v = s² / 2; both halves of the image are off by b.
  const double s = 0.1, b = 0.05, v = s * s / 2;
  Estimate x = flat(1.0f, static_cast<float>(v));
  x.half[0] = Rgb<float>(40, 30, static_cast<float>(1 + s));
  x.half[1] = Rgb<float>(40, 30, static_cast<float>(1 - s));
  const Rgb<float> halves[2] = {Rgb<float>(40, 30, static_cast<float>(1 + b)),
                                Rgb<float>(40, 30, static_cast<float>(1 + b))};
  const double unit = 1.01;
  CHECK(crossHalfErrorMap(halves, x, x.variance, x.mean)[500] ==
        doctest::Approx(unit * b * b / (unit + v)).epsilon(1e-3));
  const Estimate exact = flat(1.0f, 0.0f);
  CHECK(crossHalfErrorMap(exact.half, exact, exact.variance, exact.mean)[500] == 0);
}

TEST_CASE("The error of an image that is mixed of x and a biased one, as their errors ask for it, is told") {
  const int width = 120, height = 90;
  const double v = 0.01;
  for (const double bias : {0.0, 0.02, 0.05, 0.1, 0.3}) {
    // x deviates by n, the biased image by b: with the share w = b² / (v + b²) of x the error is least, w v.
    const double w = sqr(bias) / (v + sqr(bias));
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    Rgb<float> halves[2] = {Rgb<float>(width, height), Rgb<float>(width, height)};
    const Rgb<float> image(width, height, 1.0f), variance(width, height, static_cast<float>(v));
    double truly = 0;
    for (size_t i = 0; i < image.size(); ++i) {
      double mean = 0;
      for (Rgb<float>& half : halves) {
        const double value = 1 + w * std::sqrt(2 * v) * normal(random) + (1 - w) * bias;
        for (size_t c = 0; c < 3; ++c) half[c][i] = static_cast<float>(value);
        mean += value / 2;
      }
      truly += sqr(mean - 1) / static_cast<double>(image.size());
    }
    const Plane<float> map = mixtureErrorMap(halves, variance, image);
    double told = 0;
    for (size_t i = 0; i < map.size(); ++i) told += static_cast<double>(map[i]) / static_cast<double>(map.size());
    // Without 1 / 49 it would be w v. That bounds the error to 7 times the spread, where next to nothing of x is left.
    const double expected = w > 0 ? w * v / std::sqrt(1 + 1 / (49 * w * w)) : 0;
    CHECK(told == doctest::Approx(expected).epsilon(0.03));  // four standard errors of the spread
    if (bias >= 0.05) CHECK(told == doctest::Approx(truly).epsilon(0.25));
  }
}

TEST_CASE("What halves of all kinds tell of an error stays within what they show") {
  const Rgb<float> image(40, 30, 1.0f);
  const auto told = [&](double spread, double v) {
    const double d = std::sqrt(spread);
    const Rgb<float> halves[2] = {Rgb<float>(40, 30, static_cast<float>(1 + d)),
                                  Rgb<float>(40, 30, static_cast<float>(1 - d))};
    return static_cast<double>(mixtureErrorMap(halves, Rgb<float>(40, 30, static_cast<float>(v)), image)[500]);
  };
  CHECK(told(0, 0) == 0);
  CHECK(told(0, 1) == 0);
  CHECK(told(0.01, 0) == doctest::Approx(0.01).epsilon(1e-3));  // noisier than x: what it is
  CHECK(told(0.01, 0.005) == doctest::Approx(0.01).epsilon(1e-3));
  CHECK(told(0.01, 0.0101) == doctest::Approx(0.01).epsilon(0.02));  // x itself
  CHECK(told(1e-6, 1e30) == doctest::Approx(7e-6).epsilon(1e-3));    // filtered as far as can be
}

TEST_CASE("Where the unbiased image has not found the light, the photon map is believed") {
  // No sample has hit the caustic in the left half: half the light, and a variance that knows nothing of the rest.
  Estimate x = flat(1.0f, 1e-6f), s = flat(1.0f, 1e-3f);
  s.unbiased = false;
  s.bias = s.biasVariance = Rgb<float>(40, 30);
  for (int y = 0; y < 30; ++y)
    for (int u = 0; u < 20; ++u)
      for (size_t c = 0; c < 3; ++c) x.mean[c].at(u, y) = 0.5f;
  const FusedEstimate f = fusedEstimate(x, {&s}, nullptr);
  CHECK(f.image.mean[0].at(5, 15) > 0.99f);
  // Too bright, on the other hand, is no sign of missing light: the small variance is believed.
  for (size_t c = 0; c < 3; ++c)
    for (float& v : x.mean[c].data) v = 1.5f;
  CHECK(fusedEstimate(x, {&s}, nullptr).image.mean[0].at(5, 15) > 1.49f);
}

TEST_CASE("A noisy lamp lends the dark pixels around it no error that they cannot have") {
  Estimate x = flat(0.01f, 1e-8f);
  const size_t lamp = x.mean[0].index(20, 15);
  setPixel(x, lamp, 100, {90, 110, 95, 105}, 16);
  for (const Plane<float>& error :
       {crossHalfErrorMap(x.half, x, x.variance, x.mean), mixtureErrorMap(x.half, x.variance, x.mean)}) {
    const double beside = static_cast<double>(error[lamp + 3]);
    CHECK(static_cast<double>(error[lamp]) > 0.1);
    CHECK(beside / 0.01 < 0.02);  // relative; the lamp's own relative error is 0.0056
  }
}

}  // namespace braid::test_auto_fused
