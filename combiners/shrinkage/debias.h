// SPDX-License-Identifier: Apache-2.0
// Photon maps less the bias that they tell of themselves.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// The estimate S of an integrator that estimates its bias (B, with the variance V of that mean; ALGORITHMS 6.2), as
// S - a B. For photon maps S - B extrapolates to a radius of 0: it is without bias where irradiance is curved, and at
// straight edges of light, where S tells 0.41 of its squared bias (sppm_gather.h), 0.44 of it is left. But B is noisy:
// in an even light S and B are uncorrelated, and V is 5.3 times the variance of S. Hence
//   a = b / (b + v),  b = max(0, mean((B² - V) / u)),  v = mean(V / u),
// the best factor for a bias that B estimates without bias; means over channels and 5x5 pixels, u = S² + 0.01 with the
// channel mean of S. Nothing is taken from a pixel beyond what it has. As samples grow B falls and a with it, so that S
// keeps its limit.
//
// Halves and quarters are corrected by their own halves' B, if these are given, with the a of all samples: they show
// the noise of a B to whoever compares them. The variance becomes Var S + a² V. The bias of the result is told as that
// of S times 1 - a / 2: at a = 1 and counted twice, as for S, this is half of B², between curved irradiance, 0, and
// straight edges, 1.06. (Of S itself they have B² and 2.43 B².)
//
// Fewer than 4 passes do not tell V: then the estimate is returned as it is, as one without a told bias always is.
Estimate debiased(const Estimate& photonMap);

}  // namespace braid
