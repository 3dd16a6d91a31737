// SPDX-License-Identifier: Apache-2.0
#include "combiners/pixels/likeness.h"

#include <algorithm>
#include <cmath>

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

bool isAlike(const Features& features, int x, int y) {
  const Plane<float>& plane = features.albedo.mean[0];
  const size_t at = plane.index(x, y);
  double weight = 0, most = 0;
  for (int v = std::max(0, y - kRadius); v <= std::min(plane.height - 1, y + kRadius); ++v)
    for (int u = std::max(0, x - kRadius); u <= std::min(plane.width - 1, x + kRadius); ++u) {
      if (u == x && v == y) continue;
      const double nearness = std::exp(-static_cast<double>((u - x) * (u - x) + (v - y) * (v - y)) / 8);
      most += nearness;
      weight += nearness * std::exp(-unlikeness(features, at, plane.index(u, v)));
    }
  return weight >= kAlike * most;
}

}  // namespace braid
