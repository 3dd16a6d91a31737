// SPDX-License-Identifier: Apache-2.0
// The formula of the James-Stein combiner on hand arrays, Stein's identity, dominance over the unbiased image for any
// other image, and fireflies.
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include "combiners/pipeline/registry.h"
#include "combiners/pixels/mirror.h"
#include "combiners/shrinkage/shrinkage.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_james_stein_formula {

using namespace test;

namespace {

Rgb<float> constantImage(int width, int height, float value) { return Rgb<float>(width, height, value); }

// Pixel means of n samples of a flat image with an edge: Gaussian noise, whose deviation may differ between the left
// and the right half of the image, plus fireflies of value `firefly` with probability p a sample. The variance is the
// sample variance of the mean that an accumulator would give, from its distribution.
struct Noise {
  double left = 1, right = 1, firefly = 0, p = 0;
};

struct Replicate {
  Rgb<float> truth, x, variance;
};

Replicate replicate(int size, int n, const Noise& noise, unsigned seed) {
  std::mt19937_64 random(seed);
  Replicate r{Rgb<float>(size, size), Rgb<float>(size, size), Rgb<float>(size, size)};
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x) {
        const double base = x + 2 * y < 5 * size / 4 ? 0.3 : 1.0, deviation = x < size / 2 ? noise.left : noise.right;
        std::normal_distribution<double> gauss(0, deviation / std::sqrt(n));
        std::gamma_distribution<double> chiSquared((n - 1) / 2.0, 2.0);
        const double hits = noise.p > 0 ? static_cast<double>(std::poisson_distribution<int>(n * noise.p)(random)) : 0;
        const double share = std::min(1.0, hits / n);
        r.truth[c].at(x, y) = static_cast<float>(base + noise.p * noise.firefly);
        r.x[c].at(x, y) = static_cast<float>(base + gauss(random) + share * noise.firefly);
        r.variance[c].at(x, y) = static_cast<float>(
            (deviation * deviation * chiSquared(random) / n + noise.firefly * noise.firefly * share * (1 - share)) /
            (n - 1));
      }
  return r;
}

Rgb<float> boxBlur(const Rgb<float>& in, int radius) { return detail::boxFilter(in, radius); }

double firefliesAfter(VarianceFilter filter, double sigma) {
  const Noise noise{0.3, 0.3, 500, 1e-4};
  double error = 0;
  for (unsigned seed = 0; seed < 4; ++seed) {
    const Replicate r = replicate(64, 32, noise, 100 + seed);
    JamesSteinSettings s;
    s.filter = filter;
    s.sigma = sigma;
    s.constant = 1;
    error += meanSquaredError(jamesStein(r.x, r.variance, boxBlur(r.truth, 3), s).image, r.truth) / 4;
  }
  return error;
}

}  // namespace

TEST_CASE("The shrinkage factor is 1 - c (p - 2) sigma² / SSE, cut at zero or not, and 1 where nothing differs") {
  CHECK(shrinkageFactor(2, 8, true) == doctest::Approx(0.75));
  CHECK(shrinkageFactor(12, 8, true) == 0);
  CHECK(shrinkageFactor(12, 8, false) == doctest::Approx(-0.5));
  CHECK(shrinkageFactor(0, 0, true) == 1);
  CHECK(shrinkageFactor(5e-6, 0, true) == doctest::Approx(0.5));
  CHECK(shrinkageFactor(HUGE_VAL, HUGE_VAL, true) == 0);

  // Uniform blocks: x - y = 2, s² = 1.5 everywhere, so SSE = 225 * 4 in every mirrored block.
  const auto x = constantImage(20, 17, 3), y = constantImage(20, 17, 1), v = constantImage(20, 17, 1.5f);
  JamesSteinSettings s;
  for (const double c : {1.0, 1.25}) {
    s.constant = c;
    const double rho = 1 - c * 223 * 1.5 / 900;
    const ShrunkImage out = jamesStein(x, v, y, s);
    for (const size_t i : {size_t(0), size_t(19), size_t(171), out.image.size() - 1}) {
      CHECK(out.factor[1][i] == doctest::Approx(rho));
      CHECK(out.image[1][i] == doctest::Approx(1 + rho * 2));
    }
  }
}

TEST_CASE("Blocks, mirrored borders and the mean of factors are those of a plain implementation") {
  for (const auto& size : {std::pair{23, 18}, std::pair{5, 3}, std::pair{1, 9}}) {
    const int width = size.first, height = size.second;
    std::mt19937 random(7);
    const auto uniform = [&] { return static_cast<float>(random() % 1000) / 500; };
    Rgb<float> x(width, height), y(width, height), v(width, height);
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < x.size(); ++i) x[c][i] = uniform(), y[c][i] = uniform(), v[c][i] = uniform() / 4;
    const ShrunkImage out = jamesStein(x, v, y, JamesSteinSettings());
    const auto block = [&](int cx, int cy, const auto& value) {
      double sum = 0;
      for (int dy = -7; dy <= 7; ++dy)
        for (int dx = -7; dx <= 7; ++dx) sum += value(mirrorIndex(cx + dx, width), mirrorIndex(cy + dy, height));
      return sum;
    };
    for (size_t c = 0; c < 3; ++c) {
      Plane<double> rho(width, height);
      for (int cy = 0; cy < height; ++cy)
        for (int cx = 0; cx < width; ++cx) {
          const double sse = block(cx, cy, [&](int i, int j) {
            return sqr(static_cast<double>(x[c].at(i, j)) - static_cast<double>(y[c].at(i, j)));
          });
          const double mean = block(cx, cy, [&](int i, int j) { return static_cast<double>(v[c].at(i, j)); }) / 225;
          rho.at(cx, cy) = std::max(0.0, 1 - 1.25 * 223 * mean / sse);
        }
      for (int cy = 0; cy < height; ++cy)
        for (int cx = 0; cx < width; ++cx)
          CHECK(static_cast<double>(out.factor[c].at(cx, cy)) ==
                doctest::Approx(block(cx, cy, [&](int i, int j) { return rho.at(i, j); }) / 225).epsilon(1e-5));
    }
  }
}

TEST_CASE("Without cut and blocks the risk is Stein's: p s² - c (2 - c) (p - 2)² s⁴ E[1 / SSE]") {
  // The expectation is of 1 / SSE; DSCombiner's Eq. 5 prints SSE itself. 6000 replicates of three blocks of 25.
  // False-alarm rate of a two-sided 4.4 sigma test: 1e-5 for each of the four constants.
  for (const double c : {0.5, 1.0, 1.25, 2.0}) {
    JamesSteinSettings s;
    s.global = true;
    s.positivePart = false;
    s.constant = c;
    std::mt19937_64 random(11);
    std::normal_distribution<double> gauss;
    double sum = 0, square = 0;
    const int count = 6000;
    for (int k = 0; k < count; ++k) {
      Rgb<float> x(5, 5);
      const Rgb<float> y(5, 5, 8.5f), v(5, 5, 1.0f);
      for (size_t ch = 0; ch < 3; ++ch)
        for (float& value : x[ch].data) value = static_cast<float>(9 + gauss(random));
      const Rgb<float> out = jamesStein(x, v, y, s).image;
      double d = 0;  // observed risk less predicted risk
      for (size_t ch = 0; ch < 3; ++ch) {
        double sse = 0;
        for (size_t i = 0; i < 25; ++i) {
          sse += sqr(static_cast<double>(x[ch][i]) - 8.5);
          d += sqr(static_cast<double>(out[ch][i]) - 9) - 1;
        }
        d += c * (2 - c) * 23 * 23 / sse;
      }
      sum += d;
      square += d * d;
    }
    const double mean = sum / count, error = std::sqrt((square / count - mean * mean) / count);
    CAPTURE(c);
    CHECK(std::fabs(mean) < 4.4 * error);
    CHECK(error < 0.6);  // the gain at c = 1 is about 60
  }
}

TEST_CASE("X equal to Y comes out unchanged, and without variance X does") {
  const Replicate r = replicate(40, 16, Noise{1, 3}, 5);
  const ShrunkImage same = jamesStein(r.x, r.variance, r.x, JamesSteinSettings());
  const ShrunkImage exact = jamesStein(r.x, Rgb<float>(40, 40), Rgb<float>(40, 40), JamesSteinSettings());
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < r.x.size(); ++i) {
      const float expected = std::max(0.0f, r.x[c][i]);
      CHECK(same.image[c][i] == expected);
      CHECK(exact.image[c][i] == expected);
    }
}

TEST_CASE("For black Y and for a 15x15 box of X the error is not above that of X, whatever the noise") {
  // 12 replicates of 64² pixels; paired differences of mean squared errors. One-sided test at 4.3 sigma: false-alarm
  // rate 1e-5 a case, 36 cases.
  const Noise kinds[] = {{1, 1}, {0.2, 2}, {0.3, 0.3, 100, 1e-3}};
  for (const Noise& noise : kinds)
    for (const int n : {16, 256, 2048})
      for (const bool black : {true, false})
        for (const double constant : {1.0, 1.25}) {
          JamesSteinSettings s;
          s.constant = constant;
          double sum = 0, square = 0, ofX = 0;
          const int count = 12;
          for (unsigned seed = 0; seed < count; ++seed) {
            const Replicate r = replicate(64, n, noise, seed);
            const Rgb<float> y = black ? Rgb<float>(64, 64) : boxBlur(r.x, 7);
            const double x = meanSquaredError(r.x, r.truth);
            const double d = meanSquaredError(jamesStein(r.x, r.variance, y, s).image, r.truth) - x;
            ofX += x / count;
            sum += d;
            square += d * d;
          }
          const double mean = sum / count;
          const double error = std::sqrt(std::max(0.0, square / count - mean * mean) / (count - 1));
          CAPTURE(noise.right);
          CAPTURE(noise.p);
          CAPTURE(n);
          CAPTURE(black);
          CAPTURE(constant);
          INFO("X ", ofX, " JS ", ofX + mean);
          CHECK(mean < 4.3 * error);
          // The gain is large where noise is: at 16 samples at least a tenth, towards the blurred image.
          if (n == 16 && !black) CHECK(mean < -0.1 * ofX);
        }
}

TEST_CASE("Box variances remove fireflies; a Gaussian lets those at the rim of a block survive, the robust form all") {
  const double box = firefliesAfter(VarianceFilter::Box, 0), wide = firefliesAfter(VarianceFilter::Gaussian, 3);
  const double narrow = firefliesAfter(VarianceFilter::Gaussian, 1), robust = firefliesAfter(VarianceFilter::Robust, 0);
  INFO("box ", box, " gauss 3 ", wide, " gauss 1 ", narrow, " robust ", robust);
  CHECK(box < 0.2 * wide);
  CHECK(wide < 0.5 * narrow);
  CHECK(wide < robust);
}

TEST_CASE("Without fireflies all filters of the variance agree") {
  const Replicate r = replicate(64, 64, Noise{1, 1}, 3);
  double errors[3];
  size_t k = 0;
  for (const VarianceFilter f : {VarianceFilter::Box, VarianceFilter::Gaussian, VarianceFilter::Robust}) {
    JamesSteinSettings s;
    s.filter = f;
    errors[k++] = meanSquaredError(jamesStein(r.x, r.variance, boxBlur(r.x, 7), s).image, r.truth);
  }
  CHECK(errors[1] == doctest::Approx(errors[0]).epsilon(0.05));
  CHECK(errors[2] == doctest::Approx(errors[0]).epsilon(0.05));
}

TEST_CASE("The gate replaces a lone firefly by Y and leaves real detail alone") {
  Rgb<float> x(41, 41, 1.0f), v(41, 41, 0.01f);
  const Rgb<float> y(41, 41, 1.1f);
  for (size_t c = 0; c < 3; ++c) {
    x[c].at(20, 20) = 50;
    v[c].at(20, 20) = 2400;  // one sample of many: deviation about the value itself
    x[c].at(10, 30) = 50;    // as bright, but sure
  }
  JamesSteinSettings s;
  s.gate = true;
  const ShrunkImage out = jamesStein(x, v, y, s);
  CHECK(out.image[0].at(20, 20) == y[0].at(20, 20));
  CHECK(out.factor[0].at(20, 20) == 0);
  CHECK(out.image[0].at(10, 30) > 49.0f);
}

TEST_CASE("The constant 1.25 hurts no good Y under fireflies, hurts a nearly perfect one less than 1, and beats X") {
  for (const uint64_t n : {uint64_t(16), uint64_t(64), uint64_t(256)}) {
    CaseOptions o;
    o.width = 96;
    o.height = 72;
    o.samples = n;
    o.fireflies = 0.0005;
    o.photonBlur = 1;
    const Case good = makeCase(o);
    o.photonBlur = 0;
    const Case perfect = makeCase(o);
    const auto js = [](const Case& c, const Estimate& y, double constant) {
      MethodInputs in = inputsOf(c);
      in.biased = &y;
      in.options.set("js-regression", 0);
      in.options.set("js-constant", constant);
      return meanSquaredError(make_js()->run(in).image.mean, c.truth);
    };
    const Estimate box = detail::boxDenoised("box", good.pt(), 7);
    const double x = meanSquaredError(good.pt().mean, good.truth), y = meanSquaredError(good.sppm().mean, good.truth);
    const double combined = js(good, good.sppm(), 1.25), boxed = js(good, box, 1.25);
    const double careful = js(perfect, perfect.sppm(), 1.25), plain = js(perfect, perfect.sppm(), 1);
    INFO("n ", n, " X ", x, " good Y ", y, " JS ", combined, " box ", boxed, " perfect Y ",
         meanSquaredError(perfect.sppm().mean, perfect.truth), " JS ", careful, " with c = 1 ", plain);
    CHECK(combined <= 1.02 * y);
    CHECK(boxed < x);
    CHECK(careful < 0.75 * plain);
  }
}

}  // namespace braid::test_james_stein_formula
