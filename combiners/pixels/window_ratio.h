// SPDX-License-Identifier: Apache-2.0
// What regressions with one coefficient come to, over the window around every pixel.
#pragma once

#include <algorithm>
#include <utility>

#include "combiners/pixels/finite_float.h"
#include "combiners/pixels/mirror.h"

namespace braid {

// Σ products / Σ squares over (2 radius + 1)² pixels, mirrored at the borders, between 0 and 1; `none` where all
// squares are 0. Both planes are of one size, the squares not negative.
inline Plane<float> windowRatio(Plane<double> products, Plane<double> squares, int radius, float none) {
  products = mirrorBoxMean(products, radius);
  squares = mirrorBoxMean(squares, radius);
  Plane<float> out(products.width, products.height, kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      out[i] = squares[i] > 0 ? finiteFloat(std::clamp(products[i] / squares[i], 0.0, 1.0)) : none;
  });
  return out;
}

}  // namespace braid
