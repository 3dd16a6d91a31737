// SPDX-License-Identifier: Apache-2.0
// The learned filter that "auto" runs from few samples (step 3 of combiners/auto/auto.md).
#pragma once

#include <optional>

#include "combiners/method.h"

namespace braid {

// From so many passes on the other filters are as good without it (combiners/EXPERIMENTS.md, Auto at few samples).
inline constexpr uint64_t kLearnedPasses = 64;

// Whether it runs for so many passes; 0: not known, as of a single one that was completed.
bool learnedFilterRuns(uint64_t passes);

// What learnedFilter() takes.
MethodMemory learnedFilterMemory();

// kpn's image of x with halves. Nothing where learnedFilterRuns() says no or kpn cannot run here.
std::optional<Estimate> learnedFilter(const Estimate& x, const MethodInputs& in);

}  // namespace braid
