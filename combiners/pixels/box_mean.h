// SPDX-License-Identifier: Apache-2.0
// Averages over square windows, clipped at the borders of the image and divided by what is left of them.
#pragma once

#include <algorithm>

#include "renderer/core/box_sum.h"

namespace braid {

// Means over windows of (2 radius + 1)² pixels. A constant plane stays what it is: in doubles to the bit, in floats to
// the rounding of a sum.
template <class Out = double, class T>
Plane<Out> boxMean(const Plane<T>& in, int radius) {
  const int right = in.width - 1, bottom = in.height - 1;
  return finishedBoxSum<Out>(in, radius, WindowBorder::Clamped, [=](double sum, int x, int y) {
    const int columns = std::min(right, x + radius) - std::max(0, x - radius) + 1,
              rows = std::min(bottom, y + radius) - std::max(0, y - radius) + 1;
    return sum / (static_cast<double>(rows) * columns);
  });
}

}  // namespace braid
