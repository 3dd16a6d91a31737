// SPDX-License-Identifier: Apache-2.0
// Metrics against values derived by hand, and FLIP against a direct, non-separable evaluation of its formulas in
// double.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>
#include <tbb/global_control.h>

#include "renderer/core/error.h"
#include "tools/metrics/metrics.h"
#include "tools/metrics/tonemap.h"

namespace braid::test_metrics {

namespace {

constexpr double kPi64 = 3.14159265358979323846;
constexpr double kDegree = 3840 * kPi64 / 180;  // pixels

Rgb<float> constant(int w, int h, const Vec3& v) {
  Rgb<float> image(w, h);
  for (size_t i = 0; i < image.size(); ++i) image.set(i, v);
  return image;
}

Rgb<float> noise(int w, int h, unsigned seed, float scale = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> u(0, scale);
  Rgb<float> image(w, h);
  for (Plane<float>& p : image.channel)
    for (float& v : p.data) v = u(random);
  return image;
}

// FLIP as the paper writes it, in double, with two-dimensional kernels.
struct DirectFlip {
  using Image = std::vector<glm::dvec3>;
  using Kernel = std::function<double(int, int)>;
  int width, height;

  static glm::dmat3 matrix() {
    return glm::transpose(
        glm::dmat3(0.4123908, 0.3575843, 0.1804808, 0.2126390, 0.7151687, 0.0721923, 0.0193308, 0.1191948, 0.9505322));
  }
  static glm::dvec3 relative(const glm::dvec3& rgb) { return matrix() * rgb / (matrix() * glm::dvec3(1)); }
  static glm::dvec3 lab(const glm::dvec3& rgb) {
    const glm::dvec3 t = relative(rgb);
    const auto f = [](double v) { return v > 216.0 / 24389 ? std::cbrt(v) : (24389.0 / 27 * v + 16) / 116; };
    const double l = 116 * f(t.y) - 16;
    return {l, 0.01 * l * 500 * (f(t.x) - f(t.y)), 0.01 * l * 200 * (f(t.y) - f(t.z))};
  }
  static double hyab(const glm::dvec3& a, const glm::dvec3& b) {
    return std::abs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z);
  }
  static double largest() { return std::pow(hyab(lab({0, 1, 0}), lab({0, 0, 1})), 0.7); }
  static double colourError(const glm::dvec3& a, const glm::dvec3& b) {
    const double p = std::pow(hyab(a, b), 0.7), knee = 0.4 * largest();
    return p < knee ? 0.95 * p / knee : 0.95 + 0.05 * (p - knee) / (largest() - knee);
  }
  static double csf(int x, int y, double a1, double b1, double a2, double b2) {
    const double d2 = (x * x + y * y) / (kDegree * kDegree);
    return a1 * std::sqrt(kPi64 / b1) * std::exp(-kPi64 * kPi64 * d2 / b1) +
           a2 * std::sqrt(kPi64 / b2) * std::exp(-kPi64 * kPi64 * d2 / b2);
  }
  double filtered(const Image& in, int c, int x, int y, int radius, const Kernel& k) const {
    double sum = 0, weights = 0;
    for (int j = -radius; j <= radius; ++j)
      for (int i = -radius; i <= radius; ++i) {
        const int u = std::clamp(x + i, 0, width - 1), v = std::clamp(y + j, 0, height - 1);
        sum += k(i, j) * in[static_cast<size_t>(v * width + u)][c];
        weights += k(i, j);
      }
    return sum / weights;
  }
  // Positive weights sum to 1, negative ones to -1.
  double feature(const Image& in, int x, int y, int radius, const Kernel& k) const {
    double plus = 0, minus = 0, plusWeight = 0, minusWeight = 0;
    for (int j = -radius; j <= radius; ++j)
      for (int i = -radius; i <= radius; ++i) {
        const int u = std::clamp(x + i, 0, width - 1), v = std::clamp(y + j, 0, height - 1);
        const double w = k(i, j), value = (in[static_cast<size_t>(v * width + u)].x + 16) / 116;
        (w > 0 ? plus : minus) += w * value;
        (w > 0 ? plusWeight : minusWeight) += std::abs(w);
      }
    return plus / plusWeight + minus / minusWeight;
  }
  Image opponent(const Rgb<float>& image) const {
    Image out;
    for (size_t i = 0; i < image.size(); ++i) {
      const glm::dvec3 t = relative(glm::dvec3(image.pixel(i)));
      out.emplace_back(116 * t.y - 16, 500 * (t.x - t.y), 200 * (t.y - t.z));
    }
    return out;
  }
  glm::dvec3 perceived(const Image& in, int x, int y) const {
    const double a = filtered(in, 0, x, y, 10, [](int i, int j) { return csf(i, j, 1, 0.0047, 0, 1); });
    const double rg = filtered(in, 1, x, y, 10, [](int i, int j) { return csf(i, j, 1, 0.0053, 0, 1); });
    const double by = filtered(in, 2, x, y, 10, [](int i, int j) { return csf(i, j, 34.1, 0.04, 13.5, 0.025); });
    const double t = (a + 16) / 116;
    const glm::dvec3 xyz = glm::dvec3(t + rg / 500, t, t - by / 200) * (matrix() * glm::dvec3(1));
    return lab(glm::clamp(glm::inverse(matrix()) * xyz, 0.0, 1.0));
  }
  std::pair<double, double> features(const Image& in, int x, int y) const {
    const double sigma = 0.5 * 0.082 * kDegree;
    const auto g = [=](int i, int j) { return std::exp(-(i * i + j * j) / (2 * sigma * sigma)); };
    const Kernel ex = [=](int i, int j) { return -i * g(i, j); }, ey = [=](int i, int j) { return -j * g(i, j); };
    const Kernel px = [=](int i, int j) { return (i * i / (sigma * sigma) - 1) * g(i, j); };
    const Kernel py = [=](int i, int j) { return (j * j / (sigma * sigma) - 1) * g(i, j); };
    return {std::hypot(feature(in, x, y, 9, ex), feature(in, x, y, 9, ey)),
            std::hypot(feature(in, x, y, 9, px), feature(in, x, y, 9, py))};
  }
  double at(const Image& a, const Image& r, int x, int y) const {
    const auto [ea, pa] = features(a, x, y);
    const auto [er, pr] = features(r, x, y);
    const double f = std::sqrt(std::max(std::abs(ea - er), std::abs(pa - pr)) / std::sqrt(2.0));
    return std::pow(colourError(perceived(a, x, y), perceived(r, x, y)), 1 - f);
  }
};

double flipOfConstants(const Vec3& a, const Vec3& b) {
  const Plane<float> e = ldrFlip(constant(7, 5, a), constant(7, 5, b));
  for (float v : e.data) CHECK(v == doctest::Approx(e[0]).epsilon(1e-4));
  return static_cast<double>(e[0]);
}

}  // namespace

TEST_CASE("equal images have no error in any metric") {
  const Rgb<float> image = noise(33, 21, 1, 5);
  for (const Metric& m : metricRegistry()) {
    CAPTURE(m.name);
    const double expected = std::string(m.name) == "PSNR"   ? std::numeric_limits<double>::infinity()
                            : std::string(m.name) == "SSIM" ? 1.0
                                                            : 0.0;
    CHECK(evaluate(m, image, image).value == expected);
    CHECK(std::string(m.description).size() > 10);
  }
}

TEST_CASE("errors of single pixels follow their formulas") {
  const Rgb<float> a = constant(2, 2, Vec3(1, 2, 0)), r = constant(2, 2, Vec3(0.5f, 2, 1));
  CHECK(metric("MSE", a, r) == doctest::Approx((0.25 + 0 + 1) / 3));
  CHECK(metric("relL2", a, r) == doctest::Approx(1.25 / 3 / (sqr(3.5 / 3) + 0.01)));
  CHECK(metric("relMSE", a, r) == doctest::Approx((0.25 / 0.26 + 1 / 1.01) / 3));
  CHECK(metric("SMAPE", a, r) == doctest::Approx((0.5 / 1.501 + 1 / 1.001) / 3));
  // Black against white: the largest display difference, 1 after tone mapping.
  const Rgb<float> black = constant(20, 20, Vec3(0)), white = constant(20, 20, Vec3(1e5f));
  CHECK(metric("PSNR", black, white) == doctest::Approx(0).epsilon(1e-6));
  // Constant images: only the term of the means remains, C1 / (1 + C1).
  CHECK(metric("SSIM", black, white) == doctest::Approx(1e-4 / (1 + 1e-4)));
  CHECK(metric("dssim", black, white) == doctest::Approx(0.5 * (1 - 1e-4 / (1 + 1e-4))));
  CHECK_THROWS_AS(metric("nothing", a, r), Error);
}

TEST_CASE("the tone curve has the published values") {
  CHECK(acesTonemap(0) == 0);
  CHECK(acesTonemap(-3) == 0);
  CHECK(acesTonemap(1) == doctest::Approx(0.6 * (2.51 * 0.6 + 0.03) / (0.6 * (2.43 * 0.6 + 0.59) + 0.14)));
  CHECK(acesTonemap(1e30f) == 1);
  CHECK(acesTonemap(std::numeric_limits<float>::infinity()) == 1);
}

TEST_CASE("SSIM of a contrast change, and its independence of the sign of noise") {
  // Uniform noise of small contrast c around a mean and its mirror image: covariance is minus the variance.
  Rgb<float> a = noise(60, 60, 3, 0.1f), b = a;
  for (Plane<float>& p : b.channel)
    for (float& v : p.data) v = 0.1f - v;
  CHECK(metric("SSIM", b, a) < 0.2);
  CHECK(metric("SSIM", a, b) == doctest::Approx(metric("SSIM", b, a)));
  CHECK(metric("DSSIM", a, b) == doctest::Approx((1 - metric("SSIM", a, b)) / 2));
}

TEST_CASE("non-finite pixels are excluded or counted, for every metric") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  Rgb<float> r = noise(30, 30, 5), a = r;
  r[1].at(4, 4) = nan;
  r[0].at(9, 20) = inf;
  a[2].at(4, 4) = inf;
  for (const Metric& m : metricRegistry()) {
    CAPTURE(m.name);
    const MetricResult same = evaluate(m, a, r);
    CHECK(same.excluded == 2);
    CHECK(same.invalid == 0);
    if (!m.largerIsBetter) CHECK(same.value == 0);
    Rgb<float> broken = a;
    broken[0].at(0, 0) = nan;
    const MetricResult bad = evaluate(m, broken, r);
    CHECK(bad.invalid == 1);
    CHECK(std::isinf(bad.value));
    CHECK((bad.value > 0) == !m.largerIsBetter);
  }
  const Rgb<float> nothing = constant(3, 3, Vec3(nan));
  CHECK(std::isinf(evaluate(*findMetric("MSE"), constant(3, 3, Vec3(1)), nothing).value));
}

TEST_CASE("trimming leaves out the worst pixels, and only them") {
  const Rgb<float> r = constant(100, 10, Vec3(0));
  Rgb<float> a = constant(100, 10, Vec3(1));
  a.set(123, Vec3(1000));
  a.set(7, Vec3(3));
  const Metric& mse = *findMetric("mse");
  CHECK(evaluate(mse, a, r).value == doctest::Approx((998 + 9 + 1e6) / 1000));
  CHECK(evaluate(mse, a, r, 0.1).value == doctest::Approx((998 + 9) / 999.0));
  CHECK(evaluate(mse, a, r, 0.2).value == 1);
  CHECK(evaluate(mse, a, r, 50).value == 1);
  CHECK(evaluate(mse, a, r, 99.99).value == 1);
}

TEST_CASE("FLIP of constant colours is its colour term") {
  CHECK(flipOfConstants(Vec3(0, 1, 0), Vec3(0, 0, 1)) == doctest::Approx(1).epsilon(1e-5));
  CHECK(flipOfConstants(Vec3(0.3f, 0.2f, 0.7f), Vec3(0.3f, 0.2f, 0.7f)) == 0);
  // By hand: CIELAB of green (87.735, -86.183, 83.179), of blue (32.297, 79.188, -107.860); chroma times L/100; HyAB
  // 203.30; to the power 0.7: 41.276; knee at 0.4 of it: 16.510. White to black: 100^0.7 = 25.119, above the knee.
  CHECK(flipOfConstants(Vec3(0), Vec3(1)) ==
        doctest::Approx(0.95 + 0.05 * (25.1189 - 16.5105) / (41.276 - 16.5105)).epsilon(1e-4));
  // Greys 0.18 and 0.2: L* 49.496 and 51.837, below the knee.
  const double l = 116 * (std::cbrt(0.2) - std::cbrt(0.18));
  CHECK(flipOfConstants(Vec3(0.18f), Vec3(0.2f)) == doctest::Approx(0.95 * std::pow(l, 0.7) / 16.5105).epsilon(2e-3));
}

TEST_CASE("FLIP at a step edge has the largest feature difference") {
  // White from column 20 on, against white everywhere. At the first white column all taps of one sign see black: edge
  // strength 1.
  Rgb<float> step = constant(40, 30, Vec3(1));
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 20; ++x) step.set(step[0].index(x, y), Vec3(0));
  const Plane<float> e = ldrFlip(step, constant(40, 30, Vec3(1)));
  // Colour: the achromatic filter sees half of its weight plus half of its centre tap.
  double sum = 0;
  for (int i = -10; i <= 10; ++i) sum += std::exp(-sqr(kPi64 * i / kDegree) / 0.0047);
  const double light = 0.5 + 0.5 / sum;
  const double difference = 116 * (1 - std::cbrt(light));
  const double colour = 0.95 * std::pow(difference, 0.7) / 16.5105;
  CHECK(static_cast<double>(e.at(20, 15)) == doctest::Approx(std::pow(colour, 1 - std::pow(0.5, 0.25))).epsilon(1e-3));
  CHECK(e.at(39, 15) < 1e-2f);
}

TEST_CASE("FLIP equals the direct evaluation of its formulas") {
  const Rgb<float> a = noise(26, 23, 7), r = noise(26, 23, 8);
  const Plane<float> e = ldrFlip(a, r);
  const DirectFlip direct{26, 23};
  const auto oa = direct.opponent(a), orr = direct.opponent(r);
  for (auto [x, y] : {std::pair(0, 0), std::pair(25, 22), std::pair(13, 11), std::pair(3, 20), std::pair(24, 5)})
    CHECK(static_cast<double>(e.at(x, y)) == doctest::Approx(direct.at(oa, orr, x, y)).epsilon(2e-4));
}

TEST_CASE("HDR-FLIP: exposures, guard, and scale") {
  // ACES(0.6 x) = 0.85 at the ends: the brightest pixel (8) first, the median (0.5) last; 4 stops apart.
  Rgb<float> r = constant(5, 5, Vec3(0.5f));
  r.set(3, Vec3(8));
  const std::vector<float> stops = flipExposures(r);
  REQUIRE(stops.size() == 4);
  CHECK(acesTonemap(8 * std::exp2(stops[0])) == doctest::Approx(0.85).epsilon(1e-4));
  CHECK(acesTonemap(0.5f * std::exp2(stops[3])) == doctest::Approx(0.85).epsilon(1e-4));
  CHECK(stops[1] - stops[0] == doctest::Approx(4.0 / 3));
  // Mostly black: the median of what is not black.
  Rgb<float> dark = constant(10, 10, Vec3(0));
  dark.set(0, Vec3(1));
  dark.set(1, Vec3(1));
  for (float s : flipExposures(dark)) CHECK(std::isfinite(s));
  CHECK(std::isfinite(metric("FLIP", noise(10, 10, 9), dark)));
  const Rgb<float> black = constant(4, 4, Vec3(0));
  CHECK(flipExposures(black) == std::vector<float>{0});
  CHECK(metric("FLIP", black, black) == 0);
  CHECK(metric("FLIP", constant(4, 4, Vec3(100)), black) > 0.9);

  // The unit of light does not matter.
  const Rgb<float> a = noise(16, 16, 10), b = noise(16, 16, 11);
  Rgb<float> a2 = a, b2 = b;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < a.size(); ++i) {
      a2[c][i] *= 1024;
      b2[c][i] *= 1024;
    }
  CHECK(metric("FLIP", a2, b2) == doctest::Approx(metric("FLIP", a, b)).epsilon(1e-5));
}

TEST_CASE("metrics do not depend on threads") {
  const Rgb<float> a = noise(131, 77, 12), r = noise(131, 77, 13);
  for (const Metric& m : metricRegistry()) {
    double values[2];
    for (size_t k : {0, 1}) {
      tbb::global_control limit(tbb::global_control::max_allowed_parallelism, k == 0 ? 1 : 8);
      values[k] = evaluate(m, a, r, 0.1).value;
    }
    CHECK(values[0] == values[1]);
  }
}

}  // namespace braid::test_metrics
