// SPDX-License-Identifier: Apache-2.0
#include "combiners/measured_factors.h"

#include <utility>

#include "combiners/shrinkage.h"
#include "combiners/square_units.h"
#include "combiners/window_ratio.h"

namespace braid {

namespace {

Plane<double> unitsOf(const Estimate& x, const Rgb<float> (&y)[2], size_t c) {
  Plane<float> mean(x.mean.width(), x.mean.height(), kUnfilled);
  parallelChunks(mean.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) mean[i] = 0.5f * (y[0][c][i] + y[1][c][i]);
  });
  return squareUnits(x.mean[c], mean, x.variance.empty() ? Plane<float>() : usualVariance(x.variance[c]));
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

}  // namespace

std::array<Plane<float>, 3> measuredFactors(const Estimate& x, const Rgb<float> (&y)[2], const Plane<float>& gate,
                                            int radius, Gated pixels) {
  std::array<Plane<float>, 3> out;
  for (size_t c = 0; c < 3; ++c) {
    Terms terms = termsOf(x, y, gate, pixels, c);
    out[c] = windowRatio(std::move(terms.products), std::move(terms.squares), radius, 0);
  }
  return out;
}

std::array<Plane<float>, 3> measuredOutlierFactors(const Estimate& x, const Rgb<float> (&y)[2],
                                                   const Plane<float>& gate, int radius) {
  std::array<Plane<float>, 3> out;
  for (size_t c = 0; c < 3; ++c) {
    Terms terms = termsOf(x, y, gate, Gated::Only, c);
    out[c] = windowRatio(terms.products, terms.squares, 1, 0);
    const Plane<float> block = windowRatio(std::move(terms.products), std::move(terms.squares), radius, 0);
    parallelChunks(block.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) out[c][i] *= block[i];
    });
  }
  return out;
}

}  // namespace braid
