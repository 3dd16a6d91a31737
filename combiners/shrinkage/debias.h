// SPDX-License-Identifier: Apache-2.0
// Photon maps corrected by their own bias estimate.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// The estimate S of an integrator that estimates its bias (B, with the variance V of that mean), as S - a B with
//   a = b / (b + v),  b = max(0, mean((B² - V) / u)),  v = mean(V / u),
// means over channels and 5x5 pixels, u = S² + 0.01 with the channel mean of S: the best factor for a bias that B
// estimates without bias, but with noise (combiners/README.md, Photon maps). Nothing is taken from a pixel beyond what
// it has. As samples grow B falls and a with it, so that S keeps its limit.
//
// Halves and quarters are corrected by their own halves' B, if these are given, with the a of all samples: they show
// the noise of a B to whoever compares them. The variance becomes Var S + a² V. The bias of the result is that of S
// times 1 - a / 2: at a = 1 and counted twice, half of B², between curved irradiance, 0, and straight edges, 1.06.
//
// Fewer than 4 passes do not show V: then the estimate is returned as it is, as one without a bias estimate always is.
Estimate debiased(const Estimate& photonMap);

}  // namespace braid
