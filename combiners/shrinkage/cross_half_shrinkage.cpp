// SPDX-License-Identifier: Apache-2.0
#include "combiners/shrinkage/cross_half_shrinkage.h"

#include <algorithm>
#include <utility>

#include "combiners/pixels/finite_float.h"
#include "combiners/shrinkage/shrinkage.h"
#include "combiners/statistics/residual_scale.h"
#include "combiners/pixels/window_ratio.h"

namespace braid {

namespace {

Plane<double> unitsOf(const Estimate& x, const Rgb<float> (&y)[2], size_t c) {
  Plane<float> mean(x.mean.width(), x.mean.height(), kUnfilled);
  parallelChunks(mean.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) mean[i] = 0.5f * (y[0][c][i] + y[1][c][i]);
  });
  return residualScale(x.mean[c], mean, x.variance.empty() ? Plane<float>() : usualVariance(x.variance[c]));
}

// Of the pixels that count, by pixel: numerator and denominator of the factor; 0 in the others.
struct Terms {
  Plane<double> products, squares;
};

Terms termsOf(const Estimate& x, const Rgb<float> (&y)[2], const Plane<float>& gate, Gated pixels, size_t c) {
  const Plane<double> unit = unitsOf(x, y, c);
  Terms out{Plane<double>(x.mean.width(), x.mean.height()), Plane<double>(x.mean.width(), x.mean.height())};
  parallelChunks(unit.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if ((!gate.empty() && gate[i] > 0) != (pixels == Gated::Only)) continue;
      const auto xa = static_cast<double>(x.half[0][c][i]), xb = static_cast<double>(x.half[1][c][i]);
      const auto ya = static_cast<double>(y[0][c][i]), yb = static_cast<double>(y[1][c][i]);
      out.products[i] = ((xa - ya) * (xb - ya) + (xb - yb) * (xa - yb)) / unit[i];
      out.squares[i] = (sqr(xa - ya) + sqr(xb - yb)) / unit[i];
    }
  });
  return out;
}

// What the 3x3 pixels around (x, y) measure with it or without it, whichever is less: 0 where it is alone.
float nearFactor(const Terms& terms, int x, int y) {
  double products = 0, squares = 0;  // of the neighbours in the image
  for (int v = std::max(0, y - 1); v <= std::min(terms.squares.height - 1, y + 1); ++v)
    for (int u = std::max(0, x - 1); u <= std::min(terms.squares.width - 1, x + 1); ++u) {
      if (u == x && v == y) continue;
      products += terms.products.at(u, v);
      squares += terms.squares.at(u, v);
    }
  if (!(squares > 0)) return 0;
  const double all = (products + terms.products.at(x, y)) / (squares + terms.squares.at(x, y));
  return finiteFloat(std::clamp(std::min(all, products / squares), 0.0, 1.0));
}

}  // namespace

std::array<Plane<float>, 3> crossHalfShrinkage(const Estimate& x, const Rgb<float> (&y)[2], const Plane<float>& gate,
                                               int radius, Gated pixels) {
  std::array<Plane<float>, 3> out;
  for (size_t c = 0; c < 3; ++c) {
    Terms terms = termsOf(x, y, gate, pixels, c);
    out[c] = windowRatio(std::move(terms.products), std::move(terms.squares), radius, 0);
  }
  return out;
}

std::array<Plane<float>, 3> crossHalfFireflyShrinkage(const Estimate& x, const Rgb<float> (&y)[2],
                                                      const Plane<float>& gate, int radius) {
  std::array<Plane<float>, 3> out;
  for (size_t c = 0; c < 3; ++c) {
    Terms terms = termsOf(x, y, gate, Gated::Only, c);
    Plane<float>& factors = out[c] = Plane<float>(gate.width, gate.height);
    parallelRows(gate.height, [&](int row) {
      for (int column = 0; column < gate.width; ++column)
        if (gate.at(column, row) > 0) factors.at(column, row) = nearFactor(terms, column, row);
    });
    const Plane<float> block = windowRatio(std::move(terms.products), std::move(terms.squares), radius, 0);
    for (size_t i = 0; i < block.size(); ++i) factors[i] *= block[i];
  }
  return out;
}

}  // namespace braid
