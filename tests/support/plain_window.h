// SPDX-License-Identifier: Apache-2.0
// The window of the patch-Welch filters in words of its own, for the plain transcriptions of their formulas.
#pragma once

#include <cmath>
#include <cstdlib>

namespace braid::test {

// All pixels up to 5 away, and every second one up to 9.
inline bool inPlainWindow(int dx, int dy, double inner = 5, double outer = 9) {
  const double distance = std::hypot(dx, dy);
  return distance <= inner || (distance <= outer && std::abs(dx + dy) % 2 == 0);
}

}  // namespace braid::test
