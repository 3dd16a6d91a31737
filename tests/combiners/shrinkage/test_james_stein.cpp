// SPDX-License-Identifier: Apache-2.0
// The James-Stein combiner: its formula on hand arrays, Stein's identity, dominance over the unbiased image for any
// other image, and the regression that makes Y*.
#include <cmath>
#include <functional>
#include <random>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/pixels/mirror.h"
#include "combiners/shrinkage/optimised_bias.h"
#include "combiners/pipeline/registry.h"
#include "combiners/shrinkage/shrinkage.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_james_stein {

using namespace test;

namespace {

Rgb<float> constantImage(int width, int height, float value) { return Rgb<float>(width, height, value); }

MethodResult runJs(const Case& c, const std::string& biased, const std::map<std::string, double>& options = {}) {
  MethodInputs in = inputsOf(c, biased);
  for (const auto& [name, value] : options) in.options.set("js-" + name, value);
  return make_js()->run(in);
}

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

TEST_CASE("Y* is exact where X is affine in Y and the features, up to the ridge") {
  CaseOptions o;
  o.noise = o.photonNoise = o.featureNoise = 0;
  Case c = makeCase(o);
  Estimate x = c.pt();
  const Features& f = *c.estimates.features;
  for (size_t ch = 0; ch < 3; ++ch)
    for (size_t i = 0; i < x.mean.size(); ++i)
      x.mean[ch][i] = x.half[0][ch][i] = x.half[1][ch][i] =
          1 + 0.5f * c.sppm().mean[0][i] + 0.3f * f.normal.mean[2][i] + 0.2f * f.depth.mean[i];
  RegressionSettings s;
  s.ridge = 1e-4;
  s.fallbackWeight = 0;
  const OptimisedBias fit = optimisedBias(x, c.sppm(), &f, s);
  const double variance = meanSquaredError(x.mean, Rgb<float>(o.width, o.height, 1.5f));
  CHECK(meanSquaredError(fit.mean(), x.mean) < 1e-6 * variance);
  s.ridge = 0.1;
  const double ridged = meanSquaredError(optimisedBias(x, c.sppm(), &f, s).mean(), x.mean);
  CHECK(ridged < 1e-2 * variance);
  CHECK(ridged > 0);
}

TEST_CASE("Crossed fits take targets from one half and everything else from the other; own fits see one half only") {
  CaseOptions o;
  o.width = 40;
  o.height = 30;
  Case c = makeCase(o);
  const OptimisedBias before = optimisedBias(c.pt(), c.sppm(), &*c.estimates.features, RegressionSettings());
  Estimate x = c.pt();
  for (size_t ch = 0; ch < 3; ++ch) x.half[0][ch].at(11, 12) += 3;
  const OptimisedBias after = optimisedBias(x, c.sppm(), &*c.estimates.features, RegressionSettings());
  CHECK(!identical(before.crossed[0], after.crossed[0]));
  CHECK(identical(before.crossed[1], after.crossed[1]));
  CHECK(!identical(before.own[0], after.own[0]));
  CHECK(identical(before.own[1], after.own[1]));
  Features f = *c.estimates.features;
  f.normal.half[0][0].at(11, 12) += 0.5f;
  const OptimisedBias moved = optimisedBias(c.pt(), c.sppm(), &f, RegressionSettings());
  CHECK(identical(before.crossed[0], moved.crossed[0]));  // X^A on f^B
  CHECK(!identical(before.crossed[1], moved.crossed[1]));
  CHECK(identical(before.own[1], moved.own[1]));
  double kappa = 0;  // mean over pixels and channels of (Y^A - Y^B)² / 2
  for (size_t ch = 0; ch < 3; ++ch)
    for (size_t i = 0; i < x.mean.size(); ++i)
      kappa += sqr(static_cast<double>(c.sppm().half[0][ch][i]) - static_cast<double>(c.sppm().half[1][ch][i])) / 2;
  CHECK(before.bandwidth == doctest::Approx(kappa / (3.0 * 40 * 30)));
}

TEST_CASE("The method beats both of its inputs with Y*, whose models at every fourth pixel do as well as all") {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  for (const char* biased : {"sppm", "wide"}) {
    const Case c = makeCase(o);
    const double x = meanSquaredError(c.pt().mean, c.truth), y = meanSquaredError(c.find(biased).mean, c.truth);
    const MethodResult result = runJs(c, biased);
    const double four = meanSquaredError(result.image.mean, c.truth);
    const double one = meanSquaredError(runJs(c, biased, {{"stride", 1}}).image.mean, c.truth);
    const double plain = meanSquaredError(runJs(c, biased, {{"regression", 0}}).image.mean, c.truth);
    INFO(std::string(biased), ": X ", x, " Y ", y, " JS ", four, " stride 1 ", one, " without regression ", plain);
    CHECK(four < 0.5 * std::min(x, y));
    CHECK(plain < std::min(x, y));
    CHECK(four < 1.08 * one);
    // Halves look like the image with more noise, and the error map tells the error of the whole within a factor of 2.
    for (const Rgb<float>& half : result.image.half) CHECK(meanSquaredError(half, c.truth) < 4 * four);
    double estimated = 0;
    for (const float e : result.error.data) estimated += static_cast<double>(e) / static_cast<double>(c.truth.size());
    CHECK(estimated > 0.5 * four);
    CHECK(estimated < 2 * four);
  }
}

TEST_CASE("The fit is taken where it helps: nearly as good as the better of with and without") {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.samples = 64;
  Case c = makeCase(o);
  Estimate exact = c.find("wide"), dark = c.find("wide");
  exact.mean = exact.half[0] = exact.half[1] = c.truth;
  dark.mean = c.truth;
  for (size_t ch = 0; ch < 3; ++ch)
    for (float& v : dark.mean[ch].data) v = 0.6f * v + 0.1f;
  dark.half[0] = dark.half[1] = dark.mean;
  const auto error = [&](const Estimate& y, double regression) {
    MethodInputs in = inputsOf(c);
    in.biased = &y;
    in.options.set("js-regression", regression);
    in.options.set("js-measured", 0);
    return meanSquaredError(make_js()->run(in).image.mean, c.truth);
  };
  for (const Estimate* y : std::initializer_list<const Estimate*>{&exact, &dark, &c.find("narrow"), &c.find("wide")}) {
    const double without = error(*y, 0), with = error(*y, 1), chosen = error(*y, 2);
    INFO("without ", without, " with ", with, " chosen ", chosen);
    CHECK(chosen < 1.1 * std::min(without, with) + 1e-7);
  }
  // Both happen.
  CHECK(error(exact, 0) < 0.5 * error(exact, 1));
  CHECK(error(dark, 1) < 0.5 * error(dark, 0));
}

TEST_CASE("The combination converges to X") {
  CaseOptions o;
  o.noise = 0.001;
  o.samples = 64;
  const Case c = makeCase(o);
  for (const char* biased : {"sppm", "wide"}) {
    const double js = meanSquaredError(runJs(c, biased).image.mean, c.truth);
    CHECK(js < 2 * meanSquaredError(c.pt().mean, c.truth));
    CHECK(js < 1e-4 * meanSquaredError(c.find(biased).mean, c.truth));
  }
}

TEST_CASE("The ablations of James-Stein are what they say") {
  CaseOptions o;
  const Case c = makeCase(o);
  const auto factor = [](const MethodResult& r, size_t ch) -> const Plane<float>& { return r.aovs.at(ch).plane; };
  const MethodResult global = runJs(c, "wide", {{"regression", 0}, {"global", 1}});
  for (const float f : factor(global, 0).data) CHECK(f == factor(global, 0)[0]);
  // Y closer to X than noise allows: SSE below its expectation.
  const MethodResult cut = runJs(c, "narrow", {{"regression", 0}, {"constant", 2}});
  const MethodResult uncut = runJs(c, "narrow", {{"regression", 0}, {"constant", 2}, {"positive-part", 0}});
  const auto least = [&](const MethodResult& r) {
    return *std::min_element(factor(r, 1).data.begin(), factor(r, 1).data.end());
  };
  CHECK(least(cut) >= 0);
  CHECK(least(uncut) < 0);
  const MethodResult crossed = runJs(c, "wide", {{"crossed", 1}});
  for (size_t i = 0; i < c.truth.size(); ++i)
    CHECK(crossed.image.mean[0][i] ==
          doctest::Approx(0.5 * static_cast<double>(crossed.image.half[0][0][i] + crossed.image.half[1][0][i])));
  CHECK(crossed.error.empty());
  CHECK(meanSquaredError(crossed.image.mean, c.truth) < meanSquaredError(c.find("wide").mean, c.truth));
}

TEST_CASE("One pass gives Y; images without variance, of one pixel, or without features and halves come out finite") {
  CaseOptions o;
  o.samples = 1;
  o.width = o.height = 9;
  const Case one = makeCase(o);
  CHECK(identical(runJs(one, "wide").image.mean, one.find("wide").mean));
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{7, 3}}) {
    o = CaseOptions();
    o.width = width;
    o.height = height;
    const Case c = makeCase(o);
    CHECK(allFinite(runJs(c, "sppm").image.mean));
    MethodInputs in = inputsOf(c, "wide");
    in.features = nullptr;
    Estimate x = c.pt(), y = c.find("wide");
    x.variance = Rgb<float>();
    in.unbiased = &x;
    in.biased = &y;
    CHECK(allFinite(make_js()->run(in).image.mean));
    y.half[0] = y.half[1] = Rgb<float>();
    const MethodResult plain = make_js()->run(in);
    CHECK(allFinite(plain.image.mean));
    CHECK(plain.image.half[0].empty());
  }
  o.noise = 0;
  CHECK(allFinite(runJs(makeCase(o), "sppm").image.mean));
}

TEST_CASE("The number of threads changes no bit of James-Stein") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Case c = makeCase();
  MethodResult results[3];
  size_t k = 0;
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    results[k++] = arena.execute([&] { return runJs(c, "wide"); });
  }
  for (size_t i : {size_t(1), size_t(2)}) {
    CHECK(identical(results[0].image.mean, results[i].image.mean));
    CHECK(identical(results[0].image.half[1], results[i].image.half[1]));
    CHECK(identical(results[0].error, results[i].error));
  }
}

TEST_CASE("Whitened, a noisy lamp does not hide what Y gets wrong beside it") {
  // Quiet pixels that Y gets wrong by 30 of their deviations, about one pixel with 10⁹ times their variance.
  const int size = 31;
  Rgb<float> x(size, size, 1.0f), y(size, size, 1.3f), variance(size, size, 1e-4f);
  const size_t lamp = x[0].index(15, 15);
  for (size_t c = 0; c < 3; ++c) {
    x[c][lamp] = 500;
    y[c][lamp] = 100;
    variance[c][lamp] = 1e5f;
  }
  JamesSteinSettings box, whitened;
  whitened.filter = VarianceFilter::Whitened;
  const size_t beside = x[0].index(18, 13);
  CHECK(jamesStein(x, variance, y, box).image[0][beside] > 1.15f);
  CHECK(jamesStein(x, variance, y, whitened).image[0][beside] < 1.02f);
  // Equal variances: the units cancel.
  for (size_t c = 0; c < 3; ++c) x[c][lamp] = 1, y[c][lamp] = 1.3f, variance[c][lamp] = 1e-4f;
  for (const size_t i : {beside, lamp})
    CHECK(jamesStein(x, variance, y, whitened).factor[1][i] ==
          doctest::Approx(jamesStein(x, variance, y, box).factor[1][i]).epsilon(1e-4));
}

}  // namespace braid::test_james_stein
