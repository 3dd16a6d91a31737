// SPDX-License-Identifier: Apache-2.0
// The window of the patch-Welch filters.
#pragma once

namespace braid {

// The pixels that are averaged in: all up to a distance, 197 by default. Leaving some of them out would show: of every
// second one, as a chessboard wherever a few bright samples are most of the light (combiners/EXPERIMENTS.md, All
// neighbours).
struct PatchWelchNeighbours {
  static constexpr int kMostRadius = 8;
  int radius = kMostRadius;  // in pixels, 0 to kMostRadius
  constexpr bool contain(int dx, int dy) const { return dx * dx + dy * dy <= radius * radius; }
};

}  // namespace braid
