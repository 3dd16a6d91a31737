// SPDX-License-Identifier: Apache-2.0
// Numbers of samples that differ between tiles of pixels, and the map that says where the next ones go
// (renderer/README.md, Placement of samples). One value a tile of the film's window.
#pragma once

#include <array>
#include <cstdint>
#include <utility>

#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"
#include "renderer/core/raw_sums.h"

namespace braid {

struct SamplePlacement {
  static constexpr int kTile = 8;  // side of a tile in pixels

  SamplePlacement() : SamplePlacement(0, 0) {}
  // Of a window of so many pixels, without samples, with weights of 1.
  SamplePlacement(int width, int height);

  int width = 0, height = 0;            // of the window, in pixels
  std::array<Plane<double>, 4> count;   // samples that the passes p with p % 4 = k gave a pixel of the tile
  std::array<Plane<double>, 2> hits;    // surfaces that the tile's paths met in the passes of a half
  std::array<Plane<double>, 2> weight;  // samples that a pass of a half gives a pixel, 1 on average over the pixels

  size_t tiles() const { return count[0].size(); }
  int columns() const { return count[0].width; }
  // Of the tile's pixels inside of the window.
  int pixels(size_t tile) const;
  // The tile of a pixel of the window.
  size_t tileAt(int x, int y) const { return count[0].index(x / kTile, y / kTile); }
  double ofHalf(size_t tile, int half) const {
    return count[static_cast<size_t>(half)][tile] + count[static_cast<size_t>(half) + 2][tile];
  }
  double total(size_t tile) const { return ofHalf(tile, 0) + ofHalf(tile, 1); }
  // Whether all pixels have as many samples in each bucket.
  bool even() const;
  // The fewest and the most samples of a pixel.
  std::pair<uint64_t, uint64_t> range() const;
  // total() of every pixel.
  Plane<float> samples() const;

  // For state files: what adds up over shares, and what does not.
  void listSums(RawSums& list);
  void listMap(RawSums& list);
};

// Calls body(pixel, tile) for all pixels of the window, parallel over rows.
template <class Body>
void forEachPlacedPixel(const SamplePlacement& placement, const Body& body) {
  parallelRows(placement.height, [&](int y) {
    const size_t begin = static_cast<size_t>(y) * static_cast<size_t>(placement.width);
    for (int x = 0; x < placement.width; ++x) body(begin + static_cast<size_t>(x), placement.tileAt(x, y));
  });
}

}  // namespace braid
