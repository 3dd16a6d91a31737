// SPDX-License-Identifier: Apache-2.0
// The closed form of double shrinkage and its limits, and the radiance prior with the errors of the printed equations.
#include <cmath>
#include <functional>
#include <random>

#include <doctest/doctest.h>

#include "combiners/regression/colour_weights.h"
#include "combiners/shrinkage/double_shrinkage.h"
#include "combiners/regression/radiance_prior.h"

namespace braid::test_double_shrinkage_formula {

namespace {

// The X that maximises a posterior, by golden-section search of its negative logarithm.
double minimiser(const std::function<double(double)>& f) {
  double a = -20, b = 20;
  const double ratio = (std::sqrt(5.0) - 1) / 2;
  for (int i = 0; i < 100; ++i) {
    const double l = b - ratio * (b - a), r = a + ratio * (b - a);
    (f(l) < f(r) ? b : a) = f(l) < f(r) ? r : l;
  }
  return (a + b) / 2;
}

// A ramp in one feature, the same in both images, without noise.
struct Ramp {
  static constexpr int kSize = 40;
  Rgb<float> image;
  Plane<float> feature, noVariance;
  Ramp() : image(kSize, kSize), feature(kSize, kSize), noVariance(kSize, kSize, 0.01f) {
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) {
        feature.at(x, y) = static_cast<float>(x) / kSize;
        for (size_t c = 0; c < 3; ++c) image[c].at(x, y) = 1 + 0.5f * feature.at(x, y);
      }
  }
};

}  // namespace

TEST_CASE("Two shrinkages are the mean of three values weighted by their precisions") {
  std::mt19937 random(1);
  const auto error = [&] { return std::exp(static_cast<double>(random() % 1000) / 100 - 5); };
  for (int k = 0; k < 50; ++k) {
    const double u = error(), b = error(), p = error(), xu = error(), xb = error(), xp = error();
    const DoubleShrinkage s = doubleShrinkage(u, b, p);
    const double m = s.toBiased * xb + (1 - s.toBiased) * xu, out = s.toPrior * xp + (1 - s.toPrior) * m;
    CHECK(out == doctest::Approx((xu / u + xb / b + xp / p) / (1 / u + 1 / b + 1 / p)));
    CHECK(s.variance == doctest::Approx(1 / (1 / u + 1 / b + 1 / p)));
  }
}

TEST_CASE("Limits of the weights: a perfect input takes all, a useless one nothing") {
  const auto check = [](double u, double b, double p, double toBiased, double toPrior) {
    const DoubleShrinkage s = doubleShrinkage(u, b, p);
    CHECK(s.toBiased == doctest::Approx(toBiased));
    CHECK(s.toPrior == doctest::Approx(toPrior));
    CHECK(std::isfinite(s.variance));
  };
  check(0, 2, 1, 0, 0);
  check(2, 0, 1, 1, 0);
  check(2, 2, 0, 0.5, 1);
  check(2, 2, HUGE_VAL, 0.5, 0);
  check(HUGE_VAL, 2, 2, 1, 0.5);
  check(2, HUGE_VAL, 2, 0, 0.5);
  check(0, 0, 0, 0, 0);
  check(1e-30, 2, 1, 0, 0);
}

TEST_CASE("Erratum of Eq. 7: given X, the biased image has the mean X, not X_p") {
  // With the printed marginal, X_b says nothing about X and drops out of the maximum; Eqs. 8 to 10 need mean X.
  const double u = 0.5, b = 0.8, p = 2, xu = 1, xb = 4, xp = 2;
  const auto likelihood = [](double d, double v) { return d * d / (2 * v); };
  const double right =
      minimiser([&](double x) { return likelihood(xu - x, u) + likelihood(xb - x, b) + likelihood(x - xp, p); });
  const double printed =
      minimiser([&](double x) { return likelihood(xu - x, u) + likelihood(xb - xp, b) + likelihood(x - xp, p); });
  const DoubleShrinkage s = doubleShrinkage(u, b, p);
  const double out = s.toPrior * xp + (1 - s.toPrior) * (s.toBiased * xb + (1 - s.toBiased) * xu);
  CHECK(out == doctest::Approx(right).epsilon(1e-6));
  CHECK(std::fabs(printed - out) > 0.5);
}

TEST_CASE("Erratum of Eq. 17, sign: f_j - f_i doubles the error of the slope, f_i - f_j removes it") {
  const Ramp ramp;
  const int n = Ramp::kSize, radius = 9;
  RegressionSettings s;
  s.radius = radius;
  s.stride = 1;
  s.ridge = 1e-6;
  s.fallbackWeight = 0;
  const PriorSource source{&ramp.image, &ramp.noVariance};
  const Rgb<float> prior = radiancePrior(source, source, {{&ramp.feature}}, ramp.image, s);
  // Models of a noise-free ramp are exact: value X_j, slope 0.5. Only the weights are needed for the three forms.
  const ColourWeights weights(ramp.image, ramp.noVariance, 0.01f, true);
  double right = 0, constant = 0, printed = 0, engine = 0;
  for (int x = 0; x < n; ++x) {
    const int y = n / 2;
    double sum = 0, form[3] = {0, 0, 0};
    std::vector<float> w(static_cast<size_t>(n + WindowWeights::kRowSlack));
    for (int cx = std::max(0, x - radius); cx <= std::min(n - 1, x + radius); ++cx) {
      weights.row(cx, y, y, x, x + 1, w.data());
      const auto weight = static_cast<double>(w[0]);
      const double toPixel = static_cast<double>(ramp.feature.at(x, y)) - static_cast<double>(ramp.feature.at(cx, y));
      const auto value = static_cast<double>(ramp.image[0].at(cx, y));
      sum += weight;
      form[0] += weight * (value + 0.5 * toPixel);
      form[1] += weight * value;
      form[2] += weight * (value - 0.5 * toPixel);
    }
    const auto truth = static_cast<double>(ramp.image[0].at(x, y));
    right = std::max(right, std::fabs(form[0] / sum - truth));
    constant = std::max(constant, std::fabs(form[1] / sum - truth));
    printed = std::max(printed, std::fabs(form[2] / sum - truth));
    engine = std::max(engine, std::fabs(static_cast<double>(prior[0].at(x, y)) - truth));
  }
  INFO("largest error: right ", right, ", engine ", engine, ", no slope ", constant, ", as printed ", printed);
  CHECK(right < 1e-6);
  CHECK(engine < 1e-4);
  CHECK(constant > 0.02);
  CHECK(printed == doctest::Approx(2 * constant).epsilon(1e-3));
}

TEST_CASE("Erratum of Eq. 17, norm: without the division a constant image grows by the sum of the weights") {
  const int n = 30;
  const Rgb<float> image(n, n, 0.7f), black(n, n);
  const Plane<float> variance(n, n, 0.01f);
  RegressionSettings s;
  s.stride = 1;
  s.radius = 5;
  s.ridge = 1e-6;
  const PriorSource source{&image, &variance};
  const Rgb<float> prior = radiancePrior(source, source, {}, image, s);
  for (const float v : prior[1].data) CHECK(v == doctest::Approx(0.7).epsilon(1e-4));
  const ColourWeights weights(image, variance, 0.01f, true);
  std::vector<float> row(64);
  double printed = 0;
  for (int cy = 10; cy <= 20; ++cy)
    for (int cx = 10; cx <= 20; ++cx) {
      weights.row(cx, cy, 15, 15, 16, row.data());
      printed += static_cast<double>(row[0]) * 0.7;
    }
  CHECK(printed == doctest::Approx(121 * 0.7).epsilon(1e-4));
}

TEST_CASE("Erratum of Eq. 17, exponent: likeness beyond what noise explains does not weigh more than 1") {
  const Rgb<float> image(8, 8, 0.5f);
  const Plane<float> variance(8, 8, 0.3f);
  std::vector<float> row(64);
  ColourWeights(image, variance, 0.01f, true).row(3, 3, 3, 0, 8, row.data());
  const double v = 0.3 + 0.3, printed = std::exp(-(0 - v) / (v + 0.01));
  CHECK(printed > 2.6);
  for (size_t i = 0; i < 8; ++i) CHECK(row[i] == 1);
  // Eq. 12 subtracts nothing.
  Rgb<float> other = image;
  other[0].at(5, 3) = 1.5f;
  ColourWeights(other, variance, 0.01f, false).row(3, 3, 3, 0, 8, row.data());
  CHECK(static_cast<double>(row[5]) == doctest::Approx(std::exp(-1 / 0.61)).epsilon(1e-5));
  ColourWeights(other, variance, 0.01f, true).row(3, 3, 3, 0, 8, row.data());
  CHECK(static_cast<double>(row[5]) == doctest::Approx(std::exp(-0.4 / 0.61)).epsilon(1e-5));
}

TEST_CASE("The prior fits both images at once, each weighed by the other") {
  // Unbiased 1 everywhere, biased 2 everywhere, equal weights: one constant model gives their mean.
  const Rgb<float> u(20, 20, 1.0f), b(20, 20, 2.0f);
  const Plane<float> variance(20, 20, 0.1f);
  RegressionSettings s = stridedSettings(4, nullptr);
  s.ridge = 1e-6;
  const Rgb<float> prior = radiancePrior({&u, &variance}, {&b, &variance}, {}, u, s);
  CHECK(prior[2].at(10, 10) == doctest::Approx(1.5).epsilon(1e-2));
  // A firefly of the unbiased image lowers the weights of the *biased* pixels about it, and stays a target.
  Rgb<float> withFirefly = u;
  withFirefly[0].at(10, 10) = 100;
  const ColourWeights byUnbiased(withFirefly, variance, 0.01f, false), byBiased(b, variance, 0.01f, false);
  std::vector<float> row(64);
  byUnbiased.row(9, 10, 10, 10, 11, row.data());
  CHECK(row[0] < 1e-20f);
  byBiased.row(9, 10, 10, 10, 11, row.data());
  CHECK(row[0] == 1);
}

}  // namespace braid::test_double_shrinkage_formula
