// SPDX-License-Identifier: Apache-2.0
// What filters over square windows share: tiles, the pixel pairs of an offset, and a vectorisable exp2.
//
// The fast order of a window filter on a processor with vector units is tile by tile, offset by offset, row by row: at
// a fixed offset, neighbouring pixels do the same arithmetic on neighbouring data, and patch sums of differences are
// box sums. A pixel's sums run over the offsets in the same order in every tile, so that neither the size of the tiles
// nor the number of threads changes a bit.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"
#include "renderer/core/vectorised.h"

namespace braid {

// The least multiple of `unit` that is not below n >= 0.
constexpr int roundUp(int n, int unit) { return (n + unit - 1) / unit * unit; }

// Pixels x0 <= x < x1, y0 <= y < y1.
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool empty() const { return x1 <= x0 || y1 <= y0; }
};

inline PixelRect intersection(const PixelRect& a, const PixelRect& b) {
  return {std::max(a.x0, b.x0), std::max(a.y0, b.y0), std::min(a.x1, b.x1), std::min(a.y1, b.y1)};
}

inline PixelRect grown(const PixelRect& r, int by) { return {r.x0 - by, r.y0 - by, r.x1 + by, r.y1 + by}; }

// The pixels p of a width x height image for which p + (dx, dy) is in the image too.
inline PixelRect pairsAt(int dx, int dy, int width, int height) {
  return {std::max(0, -dx), std::max(0, -dy), std::min(width, width - dx), std::min(height, height - dy)};
}

// How many of the positions [x - radius, x + radius] lie in [begin, end); for x in that range.
inline int patchCount(int x, int radius, int begin, int end) {
  return std::min(end - 1, x + radius) - std::max(begin, x - radius) + 1;
}

// Calls body(rect) for the tiles of an image, in any order on any thread.
template <class Body>
void forEachTile(int width, int height, int tileWidth, int tileHeight, const Body& body) {
  const int columns = (width + tileWidth - 1) / tileWidth, rows = (height + tileHeight - 1) / tileHeight;
  parallelChunks(static_cast<size_t>(columns) * static_cast<size_t>(rows), 1, [&](size_t i, size_t) {
    const int x0 = static_cast<int>(i % static_cast<size_t>(columns)) * tileWidth;
    const int y0 = static_cast<int>(i / static_cast<size_t>(columns)) * tileHeight;
    body(PixelRect{x0, y0, std::min(width, x0 + tileWidth), std::min(height, y0 + tileHeight)});
  });
}

inline constexpr float kLog2E = 1.44269504088896f;

// 2^x for x <= 0; the relative error is below 5e-7, exact at 0. Arguments below kLowest, and NaN, give 2^kLowest:
// nothing in practice, and never a subnormal. Adding and subtracting 1.5 * 2^23 rounds to the nearest integer and
// leaves it in the low bits; the polynomial is the Taylor series of 2^f on [-1/2, 1/2] up to f^5, with f^6 replaced by
// the Chebyshev fit of lower degree.
template <int kLowest = -126>
inline float exp2NonPositive(float x) {
  constexpr float kMagic = 12582912.0f, kLeast = kLowest;
  x = x > kLeast ? x : kLeast;
  const float shifted = x + kMagic;
  const float f = x - (shifted - kMagic);
  float p = 0.00967589f + f * 0.00133335581f;
  p = 0.0555041087f + f * p;
  p = 0.240221092f + f * p;
  p = 1.0f + f * (0.693147181f + f * p);
  return std::bit_cast<float>(std::bit_cast<int32_t>(p) + (std::bit_cast<int32_t>(shifted) << 23));
}

}  // namespace braid
