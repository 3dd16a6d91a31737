// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/variance.h"

#include <cmath>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/window.h"

namespace braid {

namespace {

constexpr double kPriorWeight = 16;  // degrees of freedom
constexpr int kBoxRadius = 3;

float finiteVariance(float v) { return std::isfinite(v) && v > 0 ? v : 0.0f; }

// The variance of the mean from its halves, one degree of freedom a pixel.
Plane<float> varianceFromHalves(const Plane<float>& a, const Plane<float>& b, uint64_t passes) {
  const double n = static_cast<double>(passes), countA = static_cast<double>((passes + 1) / 2);
  const auto factor = static_cast<float>(countA * (n - countA) / (n * n));
  Plane<float> out(a.width, a.height, kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = finiteVariance(factor * (a[i] - b[i]) * (a[i] - b[i]));
  });
  return out;
}

// Shrinks `v` towards its box mean; `own` is the weight of the pixel's own value against the box's.
void shrink(Plane<float>& v, double own, bool robust) {
  Plane<float> roots;
  if (robust) {
    roots = Plane<float>(v.width, v.height, kUnfilled);
    parallelChunks(v.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) roots[i] = std::sqrt(std::sqrt(v[i]));
    });
  }
  const Plane<float> box = boxMean<float>(robust ? roots : v, kBoxRadius);
  parallelChunks(v.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const auto mean = static_cast<double>(box[i]), prior = robust ? sqr(sqr(mean)) : mean;
      v[i] = static_cast<float>((own * static_cast<double>(v[i]) + kPriorWeight * prior) / (own + kPriorWeight));
    }
  });
}

}  // namespace

Rgb<float> regularisedVariance(const Estimate& estimate, bool robust) {
  const uint64_t n = passesOf(estimate);
  const bool halves = !estimate.half[0].empty() && !estimate.half[1].empty() && n >= 2;
  const bool known = !estimate.variance.empty() && n >= 2;
  if (!halves && !known) return {};
  const bool fromHalves = halves && (n < 4 || !known);
  Rgb<float> out;
  for (size_t c = 0; c < 3; ++c) {
    if (fromHalves) {
      out[c] = varianceFromHalves(estimate.half[0][c], estimate.half[1][c], n);
    } else {
      const Plane<float>& given = estimate.variance[c];
      out[c] = Plane<float>(given.width, given.height, kUnfilled);
      parallelChunks(given.size(), kPixelChunk, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) out[c][i] = finiteVariance(given[i]);
      });
    }
    shrink(out[c], fromHalves ? 0.0 : static_cast<double>(n - 1), robust);
  }
  return out;
}

}  // namespace braid
