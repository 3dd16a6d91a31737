// SPDX-License-Identifier: Apache-2.0
// Images of known values with normal noise, for tests of what combiners make of biases and fireflies.
#pragma once

#include <functional>
#include <random>

#include "renderer/film/estimates.h"

namespace braid::test {

constexpr int kWidth = 120, kHeight = 90;

// An image of the given values whose halves have normal noise of this standard deviation, so that the mean's is
// 1/sqrt(2) of it, and its variance.
inline Estimate noisy(const std::function<double(int, int)>& value, double deviation, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, deviation);
  Estimate e;
  e.passes = 64;
  e.mean = e.half[0] = e.half[1] = Rgb<float>(kWidth, kHeight);
  e.variance = Rgb<float>(kWidth, kHeight, static_cast<float>(deviation * deviation / 2));
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        for (Rgb<float>& half : e.half) half[c].at(x, y) = static_cast<float>(value(x, y) + normal(random));
        e.mean[c].at(x, y) = 0.5f * (e.half[0][c].at(x, y) + e.half[1][c].at(x, y));
      }
  return e;
}

// A photon map that takes itself for unbiased.
inline Estimate photonMap(const std::function<double(int, int)>& value, double deviation, unsigned seed) {
  Estimate e = noisy(value, deviation, seed);
  e.name = "sppm";
  e.unbiased = false;
  e.bias = e.biasVariance = Rgb<float>(kWidth, kHeight);
  return e;
}

inline double one(int, int) { return 1; }

inline double squaredError(const Rgb<float>& image, double truth) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c)
    for (const float v : image[c].data) sum += sqr(static_cast<double>(v) - truth);
  return sum / (3.0 * kWidth * kHeight);
}

}  // namespace braid::test
