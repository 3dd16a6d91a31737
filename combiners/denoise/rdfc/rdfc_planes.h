// SPDX-License-Identifier: Apache-2.0
// What the filters of RDFC read: planes mirrored at their borders, whose margin is as wide as windows and patches
// reach, so that no row needs to know where the image ends. Rows are rounded up to whole vectors; what is too much is
// computed from the margin and never used.
#pragma once

#include <vector>

#include "combiners/pixels/mirror.h"
#include "renderer/core/plane.h"

namespace braid {

inline constexpr int kRdfcMargin = 32;  // >= window + patch + radius of the weights' box + kRdfcRowUnit
inline constexpr int kRdfcRowUnit = 16;
inline constexpr int kRdfcTileWidth = 128, kRdfcTileHeight = 16;
constexpr int rdfcRowCount(int n) { return (n + kRdfcRowUnit - 1) / kRdfcRowUnit * kRdfcRowUnit; }

// A plane mirrored at its borders.
class MirroredPlane {
 public:
  MirroredPlane() = default;
  explicit MirroredPlane(const Plane<float>& plane) : padded_(mirrorPadded(plane, kRdfcMargin)) {}
  const float* at(int x, int y) const { return padded_.data.data() + padded_.index(x + kRdfcMargin, y + kRdfcMargin); }
  int width() const { return padded_.width - 2 * kRdfcMargin; }
  int height() const { return padded_.height - 2 * kRdfcMargin; }

 private:
  Plane<float> padded_;
};

// One channel of what pixels are compared by.
struct RdfcChannel {
  MirroredPlane mean, variance;  // variance of the mean
  MirroredPlane spread;          // of a feature: what its denominator knows; else empty
};

// One group of channels: the colour, or a feature.
using RdfcGuide = std::vector<RdfcChannel>;

// Three values, or rows of them: for p + d, for p - d, and for the mean of both.
template <class T>
struct RdfcTriple {
  T forward, backward, both;
};
using RdfcRows = RdfcTriple<float*>;

// The offsets of a window, one of each pair ±d.
template <class Body>
inline void forEachRdfcOffset(int window, const Body& body) {
  for (int dy = -window; dy <= 0; ++dy)
    for (int dx = -window; dx <= (dy == 0 ? -1 : window); ++dx) body(dx, dy);
}

}  // namespace braid
