// SPDX-License-Identifier: Apache-2.0
// Squares and quotients of floats, computed in double, back to floats that are finite.
#pragma once

#include <algorithm>
#include <limits>

namespace braid {

// The nearest finite float; 0 for NaN.
inline float finiteFloat(double x) {
  constexpr double kMost = static_cast<double>(std::numeric_limits<float>::max());
  return x == x ? static_cast<float>(std::clamp(x, -kMost, kMost)) : 0.0f;
}

}  // namespace braid
