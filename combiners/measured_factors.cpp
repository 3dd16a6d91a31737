// SPDX-License-Identifier: Apache-2.0
#include "combiners/measured_factors.h"

#include <algorithm>

#include "combiners/finite_float.h"
#include "combiners/mirror.h"

namespace braid {

std::array<Plane<float>, 3> measuredFactors(const Estimate& x, const Rgb<float> (&y)[2], const Plane<float>& gate,
                                            int radius) {
  std::array<Plane<float>, 3> out;
  for (size_t c = 0; c < 3; ++c) {
    Plane<double> products(x.mean.width(), x.mean.height()), squares(x.mean.width(), x.mean.height());
    parallelChunks(products.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (!gate.empty() && gate[i] > 0) continue;
        const auto xa = static_cast<double>(x.half[0][c][i]), xb = static_cast<double>(x.half[1][c][i]);
        const auto ya = static_cast<double>(y[0][c][i]), yb = static_cast<double>(y[1][c][i]);
        products[i] = (xa - ya) * (xb - ya) + (xb - yb) * (xa - yb);
        squares[i] = sqr(xa - ya) + sqr(xb - yb);
      }
    });
    products = mirrorBoxMean(products, radius);
    squares = mirrorBoxMean(squares, radius);
    out[c] = Plane<float>(x.mean.width(), x.mean.height(), kUnfilled);
    parallelChunks(products.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        out[c][i] = squares[i] > 0 ? finiteFloat(std::clamp(products[i] / squares[i], 0.0, 1.0)) : 0.0f;
    });
  }
  return out;
}

}  // namespace braid
