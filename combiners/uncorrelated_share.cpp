// SPDX-License-Identifier: Apache-2.0
#include "combiners/uncorrelated_share.h"

#include <algorithm>
#include <cmath>

#include "combiners/finite_float.h"
#include "combiners/mirror.h"
#include "combiners/plane_mean.h"

namespace braid {

namespace {

constexpr int kRadius = 7, kLevelRadius = 3;
constexpr double kRelativeEpsilon = 1e-6;  // of the mean noise, for pixels without any

// level² + 0.01.
Plane<float> squaredLevels(const Plane<float>& y, const Plane<float>& z) {
  Plane<float> roots(y.width, y.height, kUnfilled);
  parallelChunks(roots.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      roots[i] = 0.5f * (std::sqrt(std::max(0.0f, y[i])) + std::sqrt(std::max(0.0f, z[i])));
  });
  Plane<float> out = mirrorBoxMean<float>(roots, kLevelRadius);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = finiteFloat(sqr(sqr(static_cast<double>(out[i]))) + 0.01);
  });
  return out;
}

}  // namespace

std::array<Plane<float>, 3> combinedShares(const Estimate& y, const Rgb<float>& z, const Rgb<float> (&combined)[2],
                                           const Rgb<float>& noise) {
  std::array<Plane<float>, 3> out;
  for (size_t c = 0; c < 3; ++c) {
    out[c] = squaredLevels(y.mean[c], z[c]);
    const double epsilon = noise.empty() ? 0 : kRelativeEpsilon * planeMean(noise[c]) + 1e-30;
    Plane<double> products(out[c].width, out[c].height), squares(out[c].width, out[c].height);
    parallelChunks(products.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const double deviation = noise.empty() ? 1 : std::sqrt(static_cast<double>(noise[c][i]) + epsilon);
        const double unit = deviation * std::sqrt(static_cast<double>(out[c][i]));
        const double dy = static_cast<double>(y.half[0][c][i]) - static_cast<double>(y.half[1][c][i]);
        const double dx = static_cast<double>(combined[0][c][i]) - static_cast<double>(combined[1][c][i]);
        products[i] = dy * (dy - dx) / unit;
        squares[i] = sqr(dy - dx) / unit;
      }
    });
    products = mirrorBoxMean(products, kRadius);
    squares = mirrorBoxMean(squares, kRadius);
    parallelChunks(products.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        out[c][i] = squares[i] > 0 ? finiteFloat(std::clamp(products[i] / squares[i], 0.0, 1.0)) : 1.0f;
    });
  }
  return out;
}

void takeShare(Rgb<float>& combined, const Rgb<float>& independent, const std::array<Plane<float>, 3>& share) {
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(combined.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        combined[c][i] =
            finiteFloat(static_cast<double>(independent[c][i] + share[c][i] * (combined[c][i] - independent[c][i])));
    });
}

}  // namespace braid
