// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/planes/window_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/core/box_sum.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

float orLargest(double value) {
  return static_cast<float>(std::min(value, static_cast<double>(std::numeric_limits<float>::max())));
}

}  // namespace

WindowCells::WindowCells(int radius, int cells) : radius_(radius), cells_(cells) {
  BRAID_ASSERT(cells % 2 == 1 && cells <= 2 * radius + 1);
  int last = -1;
  for (int d = -radius; d <= radius; ++d) {
    const int cell =
        static_cast<int>(std::lround(static_cast<double>(d) * cells / (2.0 * radius + 1))) + (cells - 1) / 2;
    if (cell != last) begin_.push_back(d);
    last = cell;
  }
  begin_.push_back(radius + 1);
  BRAID_ASSERT(begin_.size() == static_cast<size_t>(cells) + 1);
}

int WindowCells::across(int count, int radius) {
  for (int cells = 1; cells <= 2 * radius + 1; cells += 2)
    if (cells * cells == count) return cells;
  return 0;
}

// The sums over a cell are those of columns of its rows, which all cells beside it share.
void WindowCells::means(const Plane<float>& of, int y, int x0, int x1, const CellWeights& weights, float* out) const {
  const auto count = static_cast<size_t>(x1 - x0), wide = count + 2 * static_cast<size_t>(radius_);
  std::vector<size_t> mirrored(wide);
  for (size_t i = 0; i < wide; ++i)
    mirrored[i] = static_cast<size_t>(mirrorIndex(x0 - radius_ + static_cast<int>(i), of.width));
  std::vector<double> columns(wide), sum(count), numerator(count, 0.0), denominator(count, 0.0);
  for (size_t row = 0; row < static_cast<size_t>(cells_); ++row) {
    std::fill(columns.begin(), columns.end(), 0.0);
    for (int dy = begin_[row]; dy < begin_[row + 1]; ++dy) {
      const float* from = of.data.data() + of.index(0, mirrorIndex(y + dy, of.height));
      for (size_t i = 0; i < wide; ++i) columns[i] += static_cast<double>(from[mirrored[i]]);
    }
    for (size_t column = 0; column < static_cast<size_t>(cells_); ++column) {
      std::fill(sum.begin(), sum.end(), 0.0);
      for (int dx = begin_[column]; dx < begin_[column + 1]; ++dx) {
        const double* from = columns.data() + (dx + radius_);
        for (size_t i = 0; i < count; ++i) sum[i] += from[i];
      }
      const double pixels = (begin_[row + 1] - begin_[row]) * (begin_[column + 1] - begin_[column]);
      const float* w = weights.values + row * static_cast<size_t>(cells_) + column;
      for (size_t i = 0; i < count; ++i) {
        const auto weight = static_cast<double>(w[i * weights.stride]);
        numerator[i] += weight * sum[i];
        denominator[i] += weight * pixels;
      }
    }
  }
  for (size_t i = 0; i < count; ++i) out[i] = orLargest(numerator[i] / denominator[i]);
}

}  // namespace braid
