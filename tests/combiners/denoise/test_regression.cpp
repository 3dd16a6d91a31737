// SPDX-License-Identifier: Apache-2.0
// The regression engine against a plain implementation in double, and on inputs that break regressions.
#include <cmath>
#include <functional>
#include <random>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/regression/colour_weights.h"
#include "combiners/regression/normal_equations.h"
#include "combiners/regression/regression.h"
#include "combiners/pixels/simd.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_regression {

using namespace test;

namespace {

Plane<float> planeOf(int width, int height, const std::function<double(int, int)>& f) {
  Plane<float> p(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) p.at(x, y) = static_cast<float>(f(x, y));
  return p;
}

Rgb<float> imageOf(int width, int height, const std::function<double(int, int, int)>& f) {
  Rgb<float> image;
  for (int c = 0; c < 3; ++c)
    image[static_cast<size_t>(c)] = planeOf(width, height, [&](int x, int y) { return f(x, y, c); });
  return image;
}

Rgb<float> noiseImage(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  return imageOf(width, height, [&](int, int, int) { return static_cast<double>(random() >> 8) / (1 << 24); });
}

class EqualWeights final : public WindowWeights {
 public:
  void row(int, int, int, int x0, int x1, float* out) const override { std::fill_n(out, x1 - x0, 1.0f); }
};

// Weights that depend on everything they may depend on, some of them zero, and next to nothing beyond three columns.
class OddWeights final : public WindowWeights {
 public:
  explicit OddWeights(int salt) : salt_(salt) {}
  static double at(int salt, int cx, int cy, int x, int y) {
    const int h = (cx * 7 + cy * 13 + x * 29 + y * 31 + salt * 17) % 23;
    if (std::abs(x - cx) > 3) return h < 12 ? 0.0 : 1e-9;
    return h < 4 && (x != cx || y != cy) ? 0.0 : h / 23.0 + 0.05;
  }
  void row(int cx, int cy, int y, int x0, int x1, float* out) const override {
    for (int x = x0; x < x1; ++x) out[x - x0] = static_cast<float>(at(salt_, cx, cy, x, y));
  }

 private:
  int salt_;
};

// What regress() must do, with two terms of weights OddWeights(1) and (2) and reconstruction by OddWeights(3), in
// double and with Gaussian elimination.
struct Oracle {
  RegressionInputs in;
  RegressionSettings s;
  int width, height;

  std::vector<double> features(int cx, int cy, int x, int y, const std::vector<double>& scale) const {
    std::vector<double> d{1};
    for (size_t g = 0; g < in.features.size(); ++g)
      for (const Plane<float>* p : in.features[g])
        d.push_back((static_cast<double>(p->at(x, y)) - static_cast<double>(p->at(cx, cy))) * scale[g]);
    return d;
  }

  template <class Body>
  void window(int cx, int cy, const Body& body) const {
    for (int y = std::max(0, cy - s.radius); y <= std::min(height - 1, cy + s.radius); ++y)
      for (int x = std::max(0, cx - s.radius); x <= std::min(width - 1, cx + s.radius); ++x) body(x, y);
  }

  std::vector<double> scales(int cx, int cy) const {
    std::vector<double> scale(in.features.size(), 1.0);
    for (size_t g = 0; g < scale.size() && s.scaleOffset >= 0; ++g) {
      double most = 0;
      window(cx, cy, [&](int x, int y) {
        double square = 0;
        for (const Plane<float>* p : in.features[g])
          square += sqr(static_cast<double>(p->at(x, y)) - static_cast<double>(p->at(cx, cy)));
        most = std::max(most, std::sqrt(square));
      });
      scale[g] = 1 / (most + static_cast<double>(s.scaleOffset));
    }
    return scale;
  }

  // Slopes of the scaled features for one channel.
  std::vector<double> model(int cx, int cy, size_t c, const std::vector<double>& scale) const {
    const size_t n = features(cx, cy, cx, cy, scale).size();
    std::vector<std::vector<double>> m(n, std::vector<double>(n + 1, 0.0));
    window(cx, cy, [&](int x, int y) {
      const std::vector<double> d = features(cx, cy, x, y, scale);
      for (int t = 0; t < 2; ++t) {
        const double w = OddWeights::at(t + 1, cx, cy, x, y);
        const double target = static_cast<double>((*in.terms[static_cast<size_t>(t)].target)[c].at(x, y));
        for (size_t i = 0; i < n; ++i) {
          for (size_t j = 0; j < n; ++j) m[i][j] += w * d[i] * d[j];
          m[i][n] += w * d[i] * target;
        }
      }
    });
    double trace = 0;
    for (size_t i = 0; i < n; ++i) trace += m[i][i];
    for (size_t i = 0; i < n; ++i)
      if (s.ridgeKind == Ridge::Absolute)
        m[i][i] += s.ridge;
      else if (i > 0)
        m[i][i] += s.ridge * trace / static_cast<double>(n);
    for (size_t i = 0; i < n; ++i)
      for (size_t k = 0; k < n; ++k) {
        if (k == i) continue;
        const double f = m[k][i] / m[i][i];
        for (size_t j = i; j <= n; ++j) m[k][j] -= f * m[i][j];
      }
    std::vector<double> slopes(n);
    for (size_t i = 0; i < n; ++i) slopes[i] = m[i][n] / m[i][i];
    return slopes;
  }

  Rgb<double> run() const {
    Rgb<double> sum(width, height), out(width, height);
    Plane<double> weights(width, height);
    for (int r = 0; r < centreCount(height, s.stride); ++r)
      for (int k = 0; k < centreCount(width, s.stride); ++k) {
        const int cx = centrePosition(k, width, s.stride), cy = centrePosition(r, height, s.stride);
        const std::vector<double> scale = scales(cx, cy);
        for (size_t c = 0; c < 3; ++c) {
          const std::vector<double> slopes = model(cx, cy, c, scale);
          window(cx, cy, [&](int x, int y) {
            const std::vector<double> d = features(cx, cy, x, y, scale);
            double value = 0;
            for (size_t i = 0; i < d.size(); ++i) value += slopes[i] * d[i];
            const double w = OddWeights::at(3, cx, cy, x, y);
            sum[c].at(x, y) += w * value;
            if (c == 0) weights.at(x, y) += w;
          });
        }
      }
    const auto share = static_cast<double>(s.fallbackWeight);
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < weights.size(); ++i)
        out[c][i] = (sum[c][i] + share * static_cast<double>((*in.fallback)[c][i])) / (weights[i] + share);
    return out;
  }
};

// Everything that a regression of colours needs, over a 3-plane and two 1-plane features.
struct Scene {
  Rgb<float> target, second, fallback, normal;
  Plane<float> depth, flag;
  EqualWeights equal;
  OddWeights odd[3] = {OddWeights(1), OddWeights(2), OddWeights(3)};

  Scene(int width, int height)
      : target(noiseImage(width, height, 1)),
        second(noiseImage(width, height, 2)),
        fallback(noiseImage(width, height, 3)),
        normal(noiseImage(width, height, 4)),
        depth(planeOf(width, height, [](int x, int y) { return 0.3 * x + std::sin(0.7 * y); })),
        flag(planeOf(width, height, [](int x, int y) { return (x / 2 + y / 3) % 2; })) {}

  RegressionInputs inputs() const {
    RegressionInputs in;
    in.features = {{&normal[0], &normal[1], &normal[2]}, {&depth}, {&flag}};
    in.terms = {{&target, &odd[0]}, {&second, &odd[1]}};
    in.reconstruction = &odd[2];
    in.fallback = &fallback;
    return in;
  }
};

double largestDifference(const Rgb<float>& a, const Rgb<double>& b) {
  double most = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < a.size(); ++i) most = std::max(most, std::fabs(static_cast<double>(a[c][i]) - b[c][i]));
  return most;
}

double largestDifference(const Rgb<float>& a, const Rgb<float>& b) {
  double most = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < a.size(); ++i)
      most = std::max(most, std::fabs(static_cast<double>(a[c][i]) - static_cast<double>(b[c][i])));
  return most;
}

}  // namespace

TEST_CASE("The vector exponential is exact to 1e-6 and never a subnormal") {
  for (double x = 0; x > -59; x -= 0.037) {
    const double e = static_cast<double>(expNegative(broadcastLanes(static_cast<float>(x)))[0]);
    CHECK(e == doctest::Approx(std::exp(static_cast<double>(static_cast<float>(x)))).epsilon(6e-6));
  }
  CHECK(expNegative(FloatLanes{})[0] == 1.0f);
  for (const float x : {-60.0f, -1e30f, -kInfinity, std::nanf("")}) {
    const float e = expNegative(broadcastLanes(x))[kLanes - 1];
    CHECK(e > 1e-27f);
    CHECK(e < 1e-25f);
  }
}

TEST_CASE("The engine is the plain weighted regression, for strides, borders, scalings, ridges and several terms") {
  for (const int stride : {1, 2, 3})
    for (const bool scaled : {true, false})
      for (const auto& [width, height, radius] : {std::array{13, 9, 3}, {5, 290, 3}, {40, 7, 12}}) {
        if (height > 100 && !scaled) continue;
        const Scene scene(width, height);
        RegressionSettings s;
        s.radius = radius;
        s.stride = stride;
        s.scaleOffset = scaled ? 0.1f : -1.0f;
        s.ridgeKind = scaled ? Ridge::Absolute : Ridge::RelativeToTrace;
        s.ridge = scaled ? 0.1 : 1e-3;
        const Oracle oracle{scene.inputs(), s, width, height};
        CAPTURE(stride);
        CAPTURE(width);
        // Sums of about 50 products of order 1 in float.
        CHECK(largestDifference(regress(scene.inputs(), s), oracle.run()) < 1e-4);
      }
}

TEST_CASE("The engine is the plain weighted regression for 1, 4, 5 and 6 unknowns, multiplied in blocks of three") {
  const Scene scene(40, 7);
  RegressionSettings s;
  s.radius = 12;
  s.stride = 2;
  for (const size_t groups : {0u, 1u, 2u, 3u}) {
    RegressionInputs in = scene.inputs();
    in.features.resize(groups);
    CAPTURE(groups);
    CHECK(largestDifference(regress(in, s), Oracle{in, s, 40, 7}.run()) < 1e-4);
  }
}

TEST_CASE("Two images fitted together get the bits of each by itself") {
  const Scene scene(37, 29);
  RegressionInputs in = scene.inputs(), swapped = in;
  in.terms[0].secondTarget = swapped.terms[0].target = &scene.second;
  in.terms[1].secondTarget = swapped.terms[1].target = &scene.target;
  in.secondFallback = swapped.fallback = &scene.normal;
  RegressionSettings s;
  s.radius = 6;
  const auto both = regressTwo(in, s);
  CHECK(identical(both[0], regress(in, s)));
  CHECK(identical(both[1], regress(swapped, s)));
}

TEST_CASE("An image that is affine in the features comes back exactly, up to the ridge") {
  const int width = 70, height = 60;
  const Scene scene(width, height);
  const Rgb<float> affine = imageOf(width, height, [&](int x, int y, int c) {
    return 2 + 0.5 * c + 0.7 * static_cast<double>(scene.normal[1].at(x, y)) -
           0.4 * static_cast<double>(scene.depth.at(x, y)) + 0.9 * static_cast<double>(scene.flag.at(x, y));
  });
  const Rgb<float> black(width, height);
  RegressionInputs in;
  in.features = {{&scene.normal[0], &scene.normal[1], &scene.normal[2]}, {&scene.depth}, {&scene.flag}};
  in.terms = {{&affine, &scene.equal}};
  in.fallback = &black;
  for (const int stride : {1, 4}) {
    RegressionSettings s;
    s.stride = stride;
    s.fallbackWeight = 0;
    s.ridge = 1e-5;
    CHECK(largestDifference(regress(in, s), affine) < 5e-4);  // of values up to 10, in float
    s.ridge = 0.1;  // against at least 26² pixels in a corner: relative error 0.1 / 676 of the intercept
    const double error = largestDifference(regress(in, s), affine);
    CHECK(error < 0.02);
    CHECK(error > 1e-5);
  }
}

TEST_CASE("Constant and collinear features, absent weights and huge values leave a finite image and are counted") {
  const int width = 40, height = 33;
  Scene scene(width, height);
  const Plane<float> constant(width, height, 0.3f);
  Plane<float> twice = scene.depth;
  for (float& v : twice.data) v *= 2;
  RegressionInputs in = scene.inputs();
  in.terms = {{&scene.target, &scene.equal}};
  in.reconstruction = nullptr;
  in.features = {{&constant}, {&scene.depth}, {&twice}};
  RegressionSettings s;
  s.ridge = 0;
  RegressionReport report;
  const Rgb<float> out = regress(in, s, &report);
  CHECK(allFinite(out));
  CHECK(report.models == 10 * 9);
  CHECK(report.raisedRidge == report.models);
  CHECK(report.constantModels == 0);
  CHECK(report.attribute("r").text.find("90 models, 0 of them of single pixels, 90 with a raised ridge") == 0);
  // The duplicate changes nothing but rounding: the ridge shares the slope out.
  in.features = {{&scene.depth}};
  CHECK(largestDifference(out, regress(in, s)) < 1e-2);

  scene.target[0].at(3, 3) = 3e38f;
  scene.normal[1].at(20, 20) = -3e38f;
  scene.normal[1].at(22, 20) = 3e38f;
  CHECK(allFinite(regress(scene.inputs(), RegressionSettings())));
}

TEST_CASE("The ridge grows until a matrix is positive definite, and gives up with the weighted mean") {
  NormalEquations e;
  e.size = 2;
  e.matrix[0][0] = e.matrix[1][0] = e.matrix[1][1] = 4;  // of rank one
  e.rhs[0][0] = e.rhs[1][0] = 8;
  const NormalSolution raised = solve(e, 0, true);
  CHECK(raised.raisedRidge);
  CHECK(!raised.constant);
  CHECK(raised.coefficients[0][0] + raised.coefficients[1][0] == doctest::Approx(2).epsilon(1e-5));
  e.matrix[1][1] = -1e30;
  const NormalSolution constant = solve(e, 0.1, true);
  CHECK(constant.constant);
  CHECK(constant.coefficients[0][0] == 2);
  CHECK(constant.coefficients[1][0] == 0);
  e.matrix[0][0] = 0;
  CHECK(solve(e, 0.1, true).coefficients[0][0] == 0);
  NormalEquations diagonal;
  diagonal.size = 2;
  diagonal.matrix[0][0] = 9;
  diagonal.matrix[1][1] = 1;
  CHECK(solve(diagonal, 0, true).condition == doctest::Approx(9));
}

TEST_CASE("Back substitution starts at the last unknown: an upper bound one too far would read past it") {
  // The released code of James-Stein starts one past the end, where this type keeps other systems' numbers.
  NormalEquations e;
  e.size = 3;
  for (size_t i = 0; i < NormalEquations::kMaxSize; ++i)
    for (size_t j = 0; j < NormalEquations::kMaxSize; ++j) e.matrix[i][j] = i == j ? 2.0 : i < 3 && j < 3 ? 0.5 : 1e9;
  const double x[3] = {1, -2, 3};
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j) e.rhs[i][0] += e.matrix[i][j] * x[j];
  for (size_t i = 3; i < NormalEquations::kMaxSize; ++i) e.rhs[i][0] = 1e9;
  const NormalSolution s = solve(e, 0, true);
  for (size_t i = 0; i < 3; ++i) CHECK(s.coefficients[i][0] == doctest::Approx(x[i]));
}

TEST_CASE("Images of 1 x 1 and 7 x 3 pixels, strides and windows larger than the image") {
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{7, 3}, std::pair{1, 40}})
    for (const int stride : {1, 4, 64}) {
      const Scene scene(width, height);
      RegressionSettings s;
      s.stride = stride;
      const Rgb<float> out = regress(scene.inputs(), s);
      CHECK(out.width() == width);
      CHECK(out.height() == height);
      CHECK(allFinite(out));
      CHECK(centrePosition(centreCount(width, stride) - 1, width, stride) < width);
    }
}

TEST_CASE("The number of threads changes no bit of a regression") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Scene scene(61, 150);
  RegressionSettings s;
  s.radius = 9;
  s.stride = 3;
  Rgb<float> results[3];
  size_t k = 0;
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    results[k++] = arena.execute([&] { return regress(scene.inputs(), s); });
  }
  CHECK(identical(results[0], results[1]));
  CHECK(identical(results[0], results[2]));
}

TEST_CASE("A glint that resembles no strided centre comes out as its fallback, not as an average of strangers") {
  const int size = 64;
  Rgb<float> guide(size, size, 0.2f);
  for (size_t c = 0; c < 3; ++c) guide[c].at(33, 37) = 5;  // not one of the centres 2, 6, 10, …
  const ColourWeights weights(guide, 0.02f);
  RegressionInputs in;
  in.terms = {{&guide, &weights}};
  in.fallback = &guide;
  RegressionSettings s;
  RegressionReport report;
  const Rgb<float> blended = regress(in, s, &report);
  CHECK(blended[0].at(33, 37) == doctest::Approx(5));
  CHECK(report.fallbackPixels == 1);
  CHECK(blended[0].at(30, 37) == doctest::Approx(0.2).epsilon(1e-3));
  // A little likeness is enough to spoil it without the blend: the weights of all centres are small, but normalised.
  for (size_t c = 0; c < 3; ++c) guide[c].at(33, 37) = 0.2f + 0.25f;
  const ColourWeights near(guide, 0.02f);
  in.terms = {{&guide, &near}};
  s.fallbackWeight = 0;
  const double without = static_cast<double>(regress(in, s)[0].at(33, 37));
  s.fallbackWeight = 2;
  const double with = static_cast<double>(regress(in, s)[0].at(33, 37));
  CHECK(without < 0.21);
  CHECK(with > 0.44);
}

TEST_CASE("Pixels that few strided models reach get a model of their own, as with a model at every pixel") {
  // A thin line beside the centres, of its own colour and brightness gradient; noise-free targets.
  const int size = 80;
  const auto line = [](int x) { return x == 33; };
  const Rgb<float> truth =
      imageOf(size, size, [&](int x, int y, int) { return line(x) ? 3 + 0.02 * y : 0.2 + 0.001 * x; });
  const Rgb<float> guide = imageOf(size, size, [&](int x, int, int) { return line(x) ? 1.0 : 0.2; });
  const Plane<float> height = planeOf(size, size, [](int, int y) { return y / 80.0; });
  const Plane<float> across = planeOf(size, size, [](int x, int) { return x / 80.0; });
  const Rgb<float> fallback(size, size, 0.5f);
  const ColourWeights weights(guide, 0.02f);
  RegressionInputs in;
  in.features = {{&height}, {&across}};
  in.terms = {{&truth, &weights}};
  in.fallback = &fallback;
  const auto lineError = [&](const RegressionSettings& s, RegressionReport* report = nullptr) {
    const Rgb<float> out = regress(in, s, report);
    double error = 0;
    for (int y = 0; y < size; ++y)
      error += sqr(static_cast<double>(out[0].at(33, y)) - static_cast<double>(truth[0].at(33, y))) / size;
    return error;
  };
  RegressionReport report;
  const RegressionSettings own = stridedSettings(4, nullptr);
  RegressionSettings without = own;
  without.ownModelBelow = 0;
  const double with = lineError(own, &report);
  CHECK(lineError(without) > 4);  // the fallback
  CHECK(with < 0.05);
  CHECK(report.ownModels == size);
  CHECK(report.models == 400 + size);
}

TEST_CASE("Cancelled regressions return at once") {
  const Scene scene(64, 64);
  const std::atomic<bool> cancel{true};
  RegressionSettings s;
  s.cancel = &cancel;
  RegressionReport report;
  regress(scene.inputs(), s, &report);
  CHECK(report.models == 0);
}

}  // namespace braid::test_regression
