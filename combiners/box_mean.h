// SPDX-License-Identifier: Apache-2.0
// Averages over square windows, clipped at the borders of the image and divided by what is left of them.
#pragma once

#include <algorithm>

#include "renderer/film/box_sum.h"

namespace braid {

// Means over windows of (2 radius + 1)² pixels. A constant plane stays what it is, to the bit.
template <class T>
Plane<double> boxMean(const Plane<T>& in, int radius) {
  Plane<double> out = boxSum(in, radius);
  parallelRows(in.height, [&](int y) {
    const int rows = std::min(in.height - 1, y + radius) - std::max(0, y - radius) + 1;
    for (int x = 0; x < in.width; ++x) {
      const int columns = std::min(in.width - 1, x + radius) - std::max(0, x - radius) + 1;
      out.at(x, y) /= static_cast<double>(rows) * columns;
    }
  });
  return out;
}

}  // namespace braid
