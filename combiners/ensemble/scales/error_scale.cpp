// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble/scales/error_scale.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/finite_float.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kAround = 4;           // radius in pixels of the geometric mean about a pixel
constexpr double kOwnOffset = 0.01;  // of logarithms, so that black counts as dark
constexpr double kAroundOffset = 0.03;

double brightness(const Estimate& e, size_t i) {
  const double sum =
      static_cast<double>(e.mean[0][i]) + static_cast<double>(e.mean[1][i]) + static_cast<double>(e.mean[2][i]);
  return std::max(0.0, sum / 3);
}

}  // namespace

Plane<float> commonErrorRoots(const std::vector<const Estimate*>& candidates) {
  const int width = candidates[0]->mean.width(), height = candidates[0]->mean.height();
  const double count = static_cast<double>(candidates.size());
  Plane<float> own(width, height, kUnfilled), mean(width, height, kUnfilled), logarithm(width, height, kUnfilled);
  parallelChunks(own.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      double sum = 0, logs = 0;
      for (const Estimate* e : candidates) {
        const double b = brightness(*e, i);
        sum += b;
        logs += std::log(b + kOwnOffset);
      }
      own[i] = finiteFloat(std::exp(logs / count) - kOwnOffset);
      mean[i] = finiteFloat(sum / count);
      logarithm[i] = finiteFloat(std::log(sum / count + kAroundOffset));
    }
  });
  const Plane<float> near = boxMean<float>(mean, 1), around = boxMean<float>(logarithm, kAround);
  parallelChunks(own.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double geometric = std::exp(static_cast<double>(around[i])) - kAroundOffset;
      const double level = std::max(static_cast<double>(own[i]), std::min(static_cast<double>(near[i]), geometric));
      own[i] = finiteFloat(1 / std::sqrt(level * level + 0.01));
    }
  });
  return own;
}

}  // namespace braid
