// SPDX-License-Identifier: Apache-2.0
// A combined image filtered once more (combiners/EXPERIMENTS.md, Refiltering).
//
// Filters of noisy images leave blotches: weights that single pixels have chosen by noise. In the image that they made
// this noise is small, and pixels can be distinguished that looked alike in the samples. RDFC does so with its own
// images (combiners/README.md, RDFC); here it is done with what an ensemble has chosen.
#pragma once

#include <atomic>

#include "renderer/film/estimates.h"

namespace braid {

// The image and its halves, all with the same weights, by non-local means over 9x9 pixels
// (rdfc_second_pass.h) with the variance between the halves, and by features with their own noise. `passes` are those
// behind the image and the features, at least 2; the features may be null. Has no variance, as it comes. Black tiles
// once `cancel` is set.
Estimate refilter(const Estimate& image, const Features* features, uint64_t passes,
                  const std::atomic<bool>* cancel = nullptr);

}  // namespace braid
