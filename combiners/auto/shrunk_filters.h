// SPDX-License-Identifier: Apache-2.0
// What filters get wrong is left to the samples: James-Stein shrinkage towards each of them (combiners/shrinkage).
#pragma once

#include <atomic>
#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

// x shrunk towards each of the filtered images, block by block, and each half of x towards its half; named "js@" and
// the filter. x has halves and a variance. Empty images once `cancel` is set.
std::vector<Estimate> shrunkTowards(const std::vector<Estimate>& filters, const Estimate& x,
                                    const std::atomic<bool>* cancel = nullptr);

}  // namespace braid
