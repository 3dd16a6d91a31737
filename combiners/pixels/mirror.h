// SPDX-License-Identifier: Apache-2.0
// Windows that are mirrored at the borders of the image without repeating the edge, as the James-Stein combiner wants
// them: every block has the same number of pixels, and mirrored ones count twice (combiners/README.md, Windows).
#pragma once

#include "renderer/core/box_sum.h"

namespace braid {

// The plane with `radius` mirrored pixels around it.
template <class T>
Plane<T> mirrorPadded(const Plane<T>& in, int radius) {
  Plane<T> out(in.width + 2 * radius, in.height + 2 * radius, kUnfilled);
  parallelRows(out.height, [&](int y) {
    const T* from = in.data.data() + in.index(0, mirrorIndex(y - radius, in.height));
    T* to = out.data.data() + out.index(0, y);
    for (int x = 0; x < radius; ++x) to[x] = from[mirrorIndex(x - radius, in.width)];
    for (int x = 0; x < in.width; ++x) to[radius + x] = from[x];
    for (int x = radius + in.width; x < out.width; ++x) to[x] = from[mirrorIndex(x - radius, in.width)];
  });
  return out;
}

// Means over windows of (2 radius + 1)² pixels.
template <class Out = double, class T>
Plane<Out> mirrorBoxMean(const Plane<T>& in, int radius) {
  return boxSum<Out>(in, radius, WindowBorder::Mirrored, 1.0 / ((2.0 * radius + 1) * (2.0 * radius + 1)));
}

}  // namespace braid
