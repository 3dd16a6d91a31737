// SPDX-License-Identifier: Apache-2.0
// Scenes for the regression engine: images, features and weights that are cheap to state.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "combiners/regression/regression.h"

namespace braid::test::regression_scene {

inline Plane<float> planeOf(int width, int height, const std::function<double(int, int)>& f) {
  Plane<float> p(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) p.at(x, y) = static_cast<float>(f(x, y));
  return p;
}

inline Rgb<float> imageOf(int width, int height, const std::function<double(int, int, int)>& f) {
  Rgb<float> image;
  for (int c = 0; c < 3; ++c)
    image[static_cast<size_t>(c)] = planeOf(width, height, [&](int x, int y) { return f(x, y, c); });
  return image;
}

inline Rgb<float> noiseImage(int width, int height, unsigned seed) {
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

inline double largestDifference(const Rgb<float>& a, const Rgb<double>& b) {
  double most = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < a.size(); ++i) most = std::max(most, std::fabs(static_cast<double>(a[c][i]) - b[c][i]));
  return most;
}

inline double largestDifference(const Rgb<float>& a, const Rgb<float>& b) {
  double most = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < a.size(); ++i)
      most = std::max(most, std::fabs(static_cast<double>(a[c][i]) - static_cast<double>(b[c][i])));
  return most;
}

}  // namespace braid::test::regression_scene
