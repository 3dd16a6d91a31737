// SPDX-License-Identifier: Apache-2.0
// What an unbiased image shows of a photon map's bias that the photon map does not know of.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// The squared bias of `photonMap` as the halves of `unbiased` measure it, averaged over channels and 13 x 13 pixels
// with the sign of the difference: the mean of sign(X - Y) (X^A - Y^A) (X^B - Y^B), whose noise has no mean, for halves
// are independent. 0 where that is not beyond two of its standard errors; where Y is brighter than X on the whole,
// for there X may not have found the light; and without halves. A photon map's estimate of its own bias is that of a
// smooth surface's: leaves, blades and hairs that are narrower than its radius lose light that it knows nothing of.
Plane<float> crossHalfSquaredBias(const Estimate& unbiased, const Estimate& photonMap);

}  // namespace braid
