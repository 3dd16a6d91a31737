// SPDX-License-Identifier: Apache-2.0
// The variance of a mean from a sum and a sum of squares.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace braid {

// Radius of the box that compares the two variance estimates, in pixels: 9 x 9. In a larger one the noisiest pixels
// decide for more of their neighbours, while the image's sum is right with either (combiners/EXPERIMENTS.md, Box of the
// variance ratio).
inline constexpr int kVarianceBoxRadius = 4;

// (Σv²/n - mean²)/(n - 1), never negative; zero for n < 2. What the rounding of n additions in double can produce by
// itself (n 2⁻⁵³ mean², a relative standard deviation of 8e-8 of one pass at 64 passes and 3e-5 at 10⁷) counts as zero,
// so that a constant has no variance.
inline double varianceOfMean(double sum, double sumOfSquares, uint64_t n) {
  if (n < 2) return 0;
  const auto count = static_cast<double>(n);
  const double meanSquare = (sum / count) * (sum / count);
  const double spread = sumOfSquares / count - meanSquare;
  const double rounding = count * 0x1p-53 * meanSquare;
  return spread > rounding ? spread / (count - 1) : 0.0;
}

// A variance as a float. Those of samples beyond 10^19 leave the range of floats and stay at its end: an infinite one
// would later be taken for none at all.
inline float floatVariance(double variance) {
  return static_cast<float>(std::min(variance, static_cast<double>(std::numeric_limits<float>::max())));
}
inline float floatVarianceOfMean(double sum, double sumOfSquares, uint64_t n) {
  return floatVariance(varianceOfMean(sum, sumOfSquares, n));
}

}  // namespace braid
