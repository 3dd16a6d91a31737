// SPDX-License-Identifier: Apache-2.0
// The regression engine against a plain implementation in double, and its solver.
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/regression/normal_equations.h"
#include "combiners/regression/regression.h"
#include "combiners/pixels/simd.h"
#include "tests/combiners/denoise/regression_scene.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_regression {

using namespace test;
using namespace test::regression_scene;

namespace {

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

}  // namespace braid::test_regression
