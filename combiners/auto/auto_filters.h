// SPDX-License-Identifier: Apache-2.0
// The filters that "auto" runs by itself (step 3 of combiners/auto/auto.md).
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

inline constexpr uint64_t kAutoFewestPasses = 2;  // fewer: there are no halves

// Whether errors can be measured across halves. Images of other renderers may not say their passes.
bool mayBeMeasured(const Estimate& x);

// The filters of x, fewer once cancelled: a wide one, from 64 passes on its first-order fit instead, and last a careful
// one that takes no neighbour's noise for its own. Where nothing may be measured, one alone.
std::vector<Estimate> autoFilters(const Estimate& x, const Features* features, const std::atomic<bool>* cancel);

// The same filters of direct and of indirect light, added up.
std::vector<Estimate> autoFiltersOfParts(const Estimate& x, bool removeFireflies, const Features* features,
                                         const std::atomic<bool>* cancel);

}  // namespace braid
