// SPDX-License-Identifier: Apache-2.0
// Where trials before a render look: pixels of the full frame on a square grid, not of its window, so that crops and
// the shares of a farm find the same.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "renderer/session/settings.h"

namespace braid {

class PixelGrid {
 public:
  // At most so many places, at least one; `between`: the corners of those squares whose centres the others are.
  PixelGrid(const Settings& settings, uint64_t places, bool between = false);

  size_t size() const { return static_cast<size_t>(columns_) * static_cast<size_t>(rows_); }
  int x(size_t i) const { return std::min(static_cast<int>(i) % columns_ * stride_ + offset_, width_ - 1); }
  int y(size_t i) const { return std::min(static_cast<int>(i) / columns_ * stride_ + offset_, height_ - 1); }

  // By place: 1 / its brightness, the mean over its surroundings and never below a tenth of the mean of all; 0 where
  // all is black. `mean` holds a value a place.
  std::vector<float> inverseBrightness(const std::vector<double>& mean) const;

 private:
  int stride_ = 1, offset_ = 0, columns_, rows_, width_, height_;
};

}  // namespace braid
