// SPDX-License-Identifier: Apache-2.0
// Half of an estimate as an estimate of its own, for denoisers whose halves share weights.
#pragma once

#include "combiners/method.h"

namespace braid {

// Whether halves can be treated so: halves of at least two passes each, and four quarters.
bool hasHalfEstimates(const Estimate& estimate, const GivenQuarters& quarters);

// Half h (0 or 1) of the samples: mean and passes of that half, the variance that halfVariance() gives it, and for its
// halves the quarters h and h + 2 in the units of the estimate.
Estimate halfEstimate(const Estimate& estimate, const GivenQuarters& quarters, int h);

}  // namespace braid
