// SPDX-License-Identifier: Apache-2.0
// The window of the patch-Welch filters in words of its own, for the plain transcriptions of their formulas.
#pragma once

#include <cmath>

namespace braid::test {

// All pixels up to 8 away.
inline bool inPlainWindow(int dx, int dy, double radius = 8) { return std::hypot(dx, dy) <= radius; }

}  // namespace braid::test
