// SPDX-License-Identifier: Apache-2.0
#include "combiners/measured_factors.h"

#include <algorithm>

#include "combiners/finite_float.h"
#include "combiners/mirror.h"
#include "combiners/shrinkage.h"
#include "combiners/square_units.h"

namespace braid {

namespace {

Plane<double> unitsOf(const Estimate& x, const Rgb<float> (&y)[2], size_t c) {
  Plane<float> mean(x.mean.width(), x.mean.height(), kUnfilled);
  for (size_t i = 0; i < mean.size(); ++i) mean[i] = 0.5f * (y[0][c][i] + y[1][c][i]);
  return squareUnits(x.mean[c], mean, x.variance.empty() ? Plane<float>() : usualVariance(x.variance[c]));
}

}  // namespace

std::array<Plane<float>, 3> measuredFactors(const Estimate& x, const Rgb<float> (&y)[2], const Plane<float>& gate,
                                            int radius) {
  std::array<Plane<float>, 3> out;
  for (size_t c = 0; c < 3; ++c) {
    const Plane<double> unit = unitsOf(x, y, c);
    Plane<double> products(x.mean.width(), x.mean.height()), squares(x.mean.width(), x.mean.height());
    parallelChunks(products.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (!gate.empty() && gate[i] > 0) continue;
        const auto xa = static_cast<double>(x.half[0][c][i]), xb = static_cast<double>(x.half[1][c][i]);
        const auto ya = static_cast<double>(y[0][c][i]), yb = static_cast<double>(y[1][c][i]);
        products[i] = ((xa - ya) * (xb - ya) + (xb - yb) * (xa - yb)) / unit[i];
        squares[i] = (sqr(xa - ya) + sqr(xb - yb)) / unit[i];
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
