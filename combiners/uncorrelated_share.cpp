// SPDX-License-Identifier: Apache-2.0
#include "combiners/uncorrelated_share.h"

#include <utility>

#include "combiners/finite_float.h"
#include "combiners/square_units.h"
#include "combiners/window_ratio.h"

namespace braid {

namespace {

constexpr int kRadius = 7;  // of the filter, too

}  // namespace

std::array<Plane<float>, 3> combinedShares(const Estimate& y, const Rgb<float>& z, const Rgb<float> (&combined)[2],
                                           const Rgb<float>& noise) {
  std::array<Plane<float>, 3> out;
  for (size_t c = 0; c < 3; ++c) {
    const Plane<double> unit = squareUnits(y.mean[c], z[c], noise[c], LevelOf::AlikeInNoise);
    Plane<double> products(unit.width, unit.height), squares(unit.width, unit.height);
    parallelChunks(products.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const double dy = static_cast<double>(y.half[0][c][i]) - static_cast<double>(y.half[1][c][i]);
        const double dx = static_cast<double>(combined[0][c][i]) - static_cast<double>(combined[1][c][i]);
        products[i] = dy * (dy - dx) / unit[i];
        squares[i] = sqr(dy - dx) / unit[i];
      }
    });
    out[c] = windowRatio(std::move(products), std::move(squares), kRadius, 1);
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
