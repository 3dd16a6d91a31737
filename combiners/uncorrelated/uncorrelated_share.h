// SPDX-License-Identifier: Apache-2.0
// Where uncorrelated weighting does harm, and how much of it to take there.
#pragma once

#include <array>

#include "renderer/film/estimates.h"

namespace braid {

// The plain mean of the independent image y and the correlated image z, y + weight (z - y) with one weight a channel
// for all pixels: unbiased as they are, and what is left where the combination is not to be had.
struct PlainMean {
  const Estimate &y, &z;
  std::array<double, 3> weight{};  // 0: y alone

  double at(const Rgb<float>& ofY, const Rgb<float>& ofZ, size_t c, size_t i) const {
    const auto a = static_cast<double>(ofY[c][i]);
    return a + weight[c] * (static_cast<double>(ofZ[c][i]) - a);
  }
  double ofHalves(size_t h, size_t c, size_t i) const { return at(y.half[h], z.half[h], c, i); }
};

// With the weight that the best one of a pixel, var y / (var y + var z), has on average: fireflies, which would lead a
// ratio of sums, count as pixels do. Variances are those of the four quarters, as usualVariance() has them.
PlainMean plainMean(const Estimate& y, const Estimate& z);

// The share of the combination in its best mean with the plain mean m, measured by halves A and B of the samples: for
// every channel, the a in [0, 1] that minimises Σ u (m + a (x - m))² with m = m_A - m_B and x = x_A - x_B, over the
// 15x15 pixels around every pixel, mirrored at the borders:
//   a = Σ u m (m - x) / Σ u (m - x)²,   1 where both agree.
// It does not change with the sign of the differences; where their law does not either, there is no bias, by the
// argument of the paper for its weights. A rare strong sample is not lost: where its neighbours have taken their parts
// of it, it is in the window of all of them, for that is as wide as the filter's.
//
// u is one over residualScale() of y, z and `noise`, differenceNoiseLevels() or empty, with levels of pixels alike in
// noise.
std::array<Plane<float>, 3> combinedShares(const PlainMean& mean, const Rgb<float> (&combined)[2],
                                           const Rgb<float>& noise);

// mean + share (combined - mean), in place, of images or of halves: ofY and ofZ make the mean.
void takeShare(Rgb<float>& combined, const PlainMean& mean, const Rgb<float>& ofY, const Rgb<float>& ofZ,
               const std::array<Plane<float>, 3>& share);

}  // namespace braid
