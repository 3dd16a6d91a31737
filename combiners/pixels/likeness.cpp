// SPDX-License-Identifier: Apache-2.0
#include "combiners/pixels/likeness.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr double kAlbedoDeviation = 0.25, kNormalDeviation = 0.15;
constexpr int kRadius = 2;
constexpr double kAlike = 0.4;

double squaredDistance(const Rgb<float>& image, size_t i, size_t j) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double d = static_cast<double>(image[c][i]) - static_cast<double>(image[c][j]);
    sum += d * d;
  }
  return sum;
}

}  // namespace

double unlikeness(const Features& features, size_t i, size_t j) {
  return squaredDistance(features.albedo.mean, i, j) / (2 * kAlbedoDeviation * kAlbedoDeviation) +
         squaredDistance(features.normal.mean, i, j) / (2 * kNormalDeviation * kNormalDeviation);
}

Plane<float> alikePixels(const Features& features) {
  const int width = features.albedo.mean.width(), height = features.albedo.mean.height();
  Plane<float> alike(width, height, kUnfilled);
  parallelRows(height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const size_t at = alike.index(x, y);
      double weight = 0, most = 0;
      for (int v = std::max(0, y - kRadius); v <= std::min(height - 1, y + kRadius); ++v)
        for (int u = std::max(0, x - kRadius); u <= std::min(width - 1, x + kRadius); ++u) {
          if (u == x && v == y) continue;
          const double nearness = std::exp(-static_cast<double>((u - x) * (u - x) + (v - y) * (v - y)) / 8);
          most += nearness;
          weight += nearness * std::exp(-unlikeness(features, at, alike.index(u, v)));
        }
      alike[at] = weight >= kAlike * most ? 1.0f : 0.0f;
    }
  });
  return alike;
}

}  // namespace braid
