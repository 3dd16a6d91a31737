// SPDX-License-Identifier: Apache-2.0
// Weights of the patch-Welch filter that are kept for the fits of pw1: those of every pixel of a grid with its
// neighbours.
#pragma once

#include <cstdint>

#include "combiners/denoise/pw/pw_neighbours.h"
#include "renderer/core/pixel_buffer.h"

namespace braid {

// The grid holds the pixels whose coordinates are multiples of the stride. A weight takes 16 bits: next to that of a
// pixel with itself, which is 1, a rounding error of 1 / 131070 is nothing.
class PatchWelchWeights {
 public:
  // All weights are 0 at first.
  PatchWelchWeights(int width, int height, size_t images, int stride, const PatchWelchNeighbours& neighbours)
      : stride_(stride), columns_((width + stride - 1) / stride), images_(images) {
    for (int dy = -kMost; dy <= kMost; ++dy)
      for (int dx = -kMost; dx <= kMost; ++dx)
        if (neighbours.contain(dx, dy)) order_[position(dx, dy)] = count_++;
    const int rows = (height + stride - 1) / stride;
    values_ = PixelBuffer<uint16_t>(static_cast<size_t>(columns_) * static_cast<size_t>(rows) * images * count_, 0);
  }

  int stride() const { return stride_; }
  // How many neighbours there are, the pixel itself included.
  size_t count() const { return count_; }
  // The place of the neighbour at (dx, dy) among them.
  size_t order(int dx, int dy) const { return order_[position(dx, dy)]; }

  // The weights of a pixel of the grid, in that order.
  uint16_t* of(int x, int y, size_t image) { return values_.data() + first(x, y, image); }
  const uint16_t* of(int x, int y, size_t image) const { return values_.data() + first(x, y, image); }

  // Weights in [0, 1] as they are kept, and back.
  static uint16_t packed(float weight) { return static_cast<uint16_t>(weight * kOne + 0.5f); }
  static float unpacked(uint16_t value) { return static_cast<float>(value) * (1 / kOne); }

 private:
  static constexpr int kMost = PatchWelchNeighbours::kMostRadius;
  static constexpr float kOne = 65535;

  static size_t position(int dx, int dy) { return static_cast<size_t>((dy + kMost) * (2 * kMost + 1) + dx + kMost); }
  size_t first(int x, int y, size_t image) const {
    const auto pixel =
        static_cast<size_t>(y / stride_) * static_cast<size_t>(columns_) + static_cast<size_t>(x / stride_);
    return (pixel * images_ + image) * count_;
  }

  int stride_, columns_;
  size_t images_, count_ = 0;
  size_t order_[(2 * kMost + 1) * (2 * kMost + 1)] = {};
  PixelBuffer<uint16_t> values_;
};

}  // namespace braid
