// SPDX-License-Identifier: Apache-2.0
// The window of the patch-Welch filters.
#pragma once

namespace braid {

// The pixels that are averaged in: all up to the inner distance in pixels, from there to the outer one every second, as
// on a chessboard: 173 of the 253 pixels of the disc. Neighbours say much the same (combiners/EXPERIMENTS.md,
// Neighbours of the patch-Welch filter).
struct PatchWelchNeighbours {
  static constexpr int kMostOuter = 9;
  int inner = 5, outer = kMostOuter;  // 0 <= inner <= outer <= kMostOuter
  constexpr bool contain(int dx, int dy) const {
    const int distance2 = dx * dx + dy * dy;
    return distance2 <= inner * inner || (distance2 <= outer * outer && (dx + dy) % 2 == 0);
  }
};

}  // namespace braid
