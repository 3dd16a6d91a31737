// SPDX-License-Identifier: Apache-2.0
// Weighted means over square windows by weights that a network says. The pixels of a window may share weights in cells,
// so that a network says fewer of them: with as many cells as pixels across, each has its own. Windows are mirrored at
// the borders (combiners/pixels/mirror.h).
#pragma once

#include <vector>

#include "renderer/core/plane.h"

namespace braid {

// The weights of a pixel after the other, `stride` numbers apart; each row by row, not negative and not all zero.
struct CellWeights {
  const float* values = nullptr;
  size_t stride = 0;
};

class WindowCells {
 public:
  // Windows of (2 radius + 1)² pixels, in cells x cells; an odd number of at most as many as pixels across. The offset
  // d from the centre lies in cell round(d cells / (2 radius + 1)), counted from the middle one.
  WindowCells(int radius, int cells);

  int count() const { return cells_ * cells_; }
  // Means about the pixels [x0, x1) of row y.
  void means(const Plane<float>& of, int y, int x0, int x1, const CellWeights& weights, float* out) const;

  // The number across whose square this is; 0: there is none that fits such a window.
  static int across(int count, int radius);

 private:
  int radius_, cells_;
  std::vector<int> begin_;  // of the offsets of a cell, from -radius on, and the end of the last one
};

}  // namespace braid
