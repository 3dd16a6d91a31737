// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/residual_scale.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "combiners/pixels/finite_float.h"
#include "combiners/pixels/mirror.h"
#include "combiners/pixels/plane_mean.h"
#include "combiners/pixels/simd.h"

namespace braid {

namespace {

constexpr int kLevelRadius = 3;
constexpr double kRelativeEpsilon = 1e-6;  // of the mean noise, for pixels without any
constexpr float kAlike = 8;

// Sums over the neighbours of `count` pixels that are alike in noise, of their roots and of ones.
void addAlike(const float* __restrict own, const float* __restrict noise, const float* __restrict roots, int count,
              float* __restrict sum, float* __restrict alike) {
  for (int x = 0; x < count; ++x) {
    const bool is = std::max(own[x], noise[x]) <= kAlike * std::min(own[x], noise[x]);
    sum[x] += is ? roots[x] : 0.0f;
    alike[x] += is ? 1.0f : 0.0f;
  }
}

// The mean of the roots over the window of every pixel, of those that are alike in noise; itself always is.
Plane<float> meansOfAlike(const Plane<float>& roots, const Plane<float>& noise) {
  const Plane<float> paddedRoots = mirrorPadded(roots, kLevelRadius), paddedNoise = mirrorPadded(noise, kLevelRadius);
  Plane<float> out(roots.width, roots.height, kUnfilled);
  parallelRows(out.height, [&](int y) {
    const auto width = static_cast<size_t>(out.width);
    std::vector<float> sum(width), alike(width);
    const auto rowOf = [&](const Plane<float>& padded, int dx, int dy) {
      return padded.data.data() + padded.index(kLevelRadius + dx, y + kLevelRadius + dy);
    };
    runVectorised([&] {
      for (int dy = -kLevelRadius; dy <= kLevelRadius; ++dy)
        for (int dx = -kLevelRadius; dx <= kLevelRadius; ++dx)
          addAlike(rowOf(paddedNoise, 0, 0), rowOf(paddedNoise, dx, dy), rowOf(paddedRoots, dx, dy), out.width,
                   sum.data(), alike.data());
    });
    for (size_t x = 0; x < width; ++x) {
      const size_t i = out.index(static_cast<int>(x), y);
      out[i] = alike[x] > 0 ? sum[x] / alike[x] : roots[i];
    }
  });
  return out;
}

}  // namespace

Plane<double> residualScale(const Plane<float>& a, const Plane<float>& b, const Plane<float>& noise, LevelOf of) {
  Plane<float> levels(a.width, a.height, kUnfilled);
  parallelChunks(levels.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      levels[i] = 0.5f * (std::sqrt(std::max(0.0f, a[i])) + std::sqrt(std::max(0.0f, b[i])));
  });
  levels = of == LevelOf::AlikeInNoise && !noise.empty() ? meansOfAlike(levels, noise)
                                                         : mirrorBoxMean<float>(levels, kLevelRadius);
  const double epsilon = noise.empty() ? 0 : kRelativeEpsilon * planeMean(noise) + 1e-30;
  Plane<double> out(a.width, a.height);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float squaredLevel = finiteFloat(sqr(sqr(static_cast<double>(levels[i]))) + 0.01);
      const double deviation = noise.empty() ? 1 : std::sqrt(static_cast<double>(noise[i]) + epsilon);
      out[i] = deviation * std::sqrt(static_cast<double>(squaredLevel));
    }
  });
  return out;
}

}  // namespace braid
