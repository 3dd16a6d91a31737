// SPDX-License-Identifier: Apache-2.0
// Weighted sums over a window for every pixel of a tile, several offsets at a time: the sums are read and written once
// for all of them, which is what such a filter spends its time on.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "combiners/pixels/window.h"
#include "renderer/core/plane.h"

namespace braid {

// One object per tile and thread. The order of additions follows from the order of the offsets alone.
class TileSums {
 public:
  static constexpr size_t kAtOnce = 4;  // offsets

  // `tile` lies in the planes, which are finite, at least one, and of one size. `window`: the largest offset in x or y.
  // `fourthPowers`: sums weighted by w⁴ are kept as well.
  TileSums(const PixelRect& tile, int window, std::span<const Plane<float>* const> in, bool fourthPowers);

  // Adds the pixels at p + (dx, dy) with the weights of the pixels p of the tile, row by row, tile.width() apart. They
  // are 0 where that lies outside the planes, and stay as they are until kAtOnce further calls or finish().
  void add(const float* weights, int dx, int dy);
  // After the last offset.
  void finish();
  // Writes the weighted mean of a plane, by w or by w⁴, to the tile's pixels of `out`.
  void mean(size_t plane, bool fourthPower, Plane<float>& out) const;

 private:
  void flush();
  float* sums(size_t quantity) { return sums_.data() + quantity * area_; }

  PixelRect tile_;
  int window_;
  size_t planes_, area_, pitch_, planeSize_;  // of padded_
  bool fourthPowers_;
  std::vector<float> padded_;  // the planes about the tile; 0 outside of them
  std::vector<float> sums_;    // of every plane, then of the weights; and the same by fourth powers
  std::vector<float> nothing_;
  size_t pending_ = 0;
  std::array<const float*, kAtOnce> weights_;
  std::array<size_t, kAtOnce> shifts_;  // of the offset in padded_
};

}  // namespace braid
