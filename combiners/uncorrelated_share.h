// SPDX-License-Identifier: Apache-2.0
// Where uncorrelated weighting does harm, and how much of it to take there.
#pragma once

#include <array>

#include "renderer/film/estimates.h"

namespace braid {

// The share of the combination in its best mean with the independent image y, measured by halves A and B of the
// samples: for every channel, the a in [0, 1] that minimises Σ u (y + a (x - y))² with y = y_A - y_B and x = x_A - x_B,
// over the 15x15 pixels around every pixel, mirrored at the borders:
//   a = Σ u y (y - x) / Σ u (y - x)²,   1 where both agree.
// It does not change with the sign of the differences; where their law does not either, there is no bias, by the
// argument of the paper for its weights. A rare strong sample is not lost: where its neighbours have taken their parts
// of it, it is in the window of all of them, for that is as wide as the filter's.
//
// u is one over squareUnits() of y, z and `noise`, noiseLevels() or empty, with levels of pixels alike in noise.
std::array<Plane<float>, 3> combinedShares(const Estimate& y, const Rgb<float>& z, const Rgb<float> (&combined)[2],
                                           const Rgb<float>& noise);

// independent + share (combined - independent), in place.
void takeShare(Rgb<float>& combined, const Rgb<float>& independent, const std::array<Plane<float>, 3>& share);

}  // namespace braid
