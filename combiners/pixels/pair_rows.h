// SPDX-License-Identifier: Apache-2.0
// Filters over windows whose weights are the same for both pixels of a pair: tile by tile, each pair is met once and
// adds to the sums of both pixels. A pixel's sums run over the pairs in the same order in every tile, so that neither
// the size of the tiles nor the number of threads changes a bit.
#pragma once

#include <algorithm>

#include "combiners/pixels/window.h"

namespace braid {

// Columns begin <= x < end; empty where end <= begin.
struct Columns {
  int begin = 0, end = 0;
  bool empty() const { return end <= begin; }
  int count() const { return std::max(0, end - begin); }
};

// The pairs of p = (x, y) and q = p + (dx, dy): of `first` p is in the tile, of `second` q is. Columns are those of p.
struct PairRow {
  int dx = 0, dy = 0, y = 0;
  Columns first, second;
  // All columns, and those between them.
  Columns all() const {
    if (first.empty()) return second;
    if (second.empty()) return first;
    return {std::min(first.begin, second.begin), std::max(first.end, second.end)};
  }
};

// Calls body(row) for all rows of pairs in `image`, at most `radius` pixels apart in x and y and at multiples of
// `step`, with a pixel in the tile; not for pairs of a pixel and itself. Of both pixels of a pair p is the upper or
// left one. All pairs of one row p come one after the other, for the sums of few rows stay in the first cache.
template <class Body>
void forPairRows(const PixelRect& tile, const PixelRect& image, int radius, int step, const Body& body) {
  const int reach = radius / step * step;
  const auto isInTile = [&](int y) { return y >= tile.y0 && y < tile.y1; };
  for (int y = std::max(image.y0, tile.y0 - reach); y < std::min(image.y1, tile.y1); ++y)
    for (int dy = 0; dy <= reach && y + dy < image.y1; dy += step)
      for (int dx = dy > 0 ? -reach : step; dx <= reach; dx += step) {
        PairRow row{dx, dy, y, {}, {}};
        const int begin = image.x0 - std::min(0, dx), end = image.x1 - std::max(0, dx);
        if (isInTile(y)) row.first = {std::max(tile.x0, begin), std::min(tile.x1, end)};
        if (isInTile(y + dy)) row.second = {std::max(tile.x0 - dx, begin), std::min(tile.x1 - dx, end)};
        if (!row.first.empty() || !row.second.empty()) body(row);
      }
}

}  // namespace braid
