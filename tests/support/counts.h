// SPDX-License-Identifier: Apache-2.0
// Pearson's chi-squared test of counts in cells that a test chooses itself.
#pragma once

#include <vector>

#include "tests/support/statistics/chi_squared.h"

namespace braid::test {

// Significance of the observed counts against the expected ones; neighbouring cells that expect little are pooled.
inline double pValueOf(const std::vector<double>& observed, const std::vector<double>& expected) {
  double statistic = 0, poolObserved = 0, poolExpected = 0;
  int cells = 0;
  for (size_t i = 0; i < expected.size(); ++i) {
    poolObserved += observed[i];
    poolExpected += expected[i];
    if (poolExpected < 50) continue;
    statistic += sqr(poolObserved - poolExpected) / poolExpected;
    poolObserved = poolExpected = 0;
    ++cells;
  }
  return cells > 1 ? gammaQ(0.5 * (cells - 1), 0.5 * statistic) : 1;
}

}  // namespace braid::test
