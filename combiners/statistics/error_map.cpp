// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/error_map.h"

#include <algorithm>

#include "renderer/core/box_sum.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kBiasRadius = 6;  // 13 x 13 pixels

}  // namespace

Plane<float> squaredBias(const Estimate& e) {
  Plane<float> out(e.mean.width(), e.mean.height());
  if (e.bias.empty()) return out;
  const Plane<double> pixels = boxSum(Plane<float>(out.width, out.height, 1.0f), kBiasRadius);
  Plane<double> square(out.width, out.height);
  for (size_t c = 0; c < 3; ++c) {
    for (size_t i = 0; i < square.size(); ++i) square[i] = sqr(static_cast<double>(e.bias[c][i]));
    const Plane<double> squares = boxSum(square, kBiasRadius), noise = boxSum(e.biasVariance[c], kBiasRadius);
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        out[i] += static_cast<float>(std::max(0.0, squares[i] - noise[i]) / (3 * pixels[i]));
    });
  }
  return out;
}

bool knowsError(const Estimate& e) { return e.passes >= 2 && !e.variance.empty(); }

Plane<float> errorMap(const Estimate& e) {
  Plane<float> out = squaredBias(e);
  if (e.variance.empty()) return out;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < out.size(); ++i) out[i] += e.variance[c][i] / 3;
  return out;
}

}  // namespace braid
