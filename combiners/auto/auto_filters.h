// SPDX-License-Identifier: Apache-2.0
// The filters that "auto" runs by itself (step 3 of combiners/auto/auto.md).
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

// The filters of x, fewer once cancelled: a wide one, from 64 passes on its first-order fit instead, and last a careful
// one that takes no neighbour's noise for its own.
std::vector<Estimate> autoFilters(const Estimate& x, const Features* features, const std::atomic<bool>* cancel);

// The same filters of direct and of indirect light, added up.
std::vector<Estimate> autoFiltersOfParts(const Estimate& x, bool removeFireflies, const Features* features,
                                         const std::atomic<bool>* cancel);

}  // namespace braid
