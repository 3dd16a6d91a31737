// SPDX-License-Identifier: Apache-2.0
// The second pass of RDFC (combiners/README.md, RDFC): filtered images have little noise left, and the variance between
// their halves says how much, so that non-local means see what the samples could not show.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "combiners/denoise/rdfc/rdfc_planes.h"
#include "renderer/core/plane.h"

namespace braid {

struct RdfcSecondPass {
  float k = 0.45f;  // sensitivity: larger filters more
  int window = 5;   // radius, at most 10
};

// The images filtered with the same weights: by `mean`, by the variance between the last two images, which are its
// halves of `passes` >= 2 passes, and by the features; these may be none. Black tiles once `cancel` is set.
std::vector<Rgb<float>> rdfcSecondPass(const std::vector<const Rgb<float>*>& images, const Rgb<float>& mean,
                                       const std::vector<RdfcGuide>& features, uint64_t passes,
                                       const RdfcSecondPass& settings = {}, const std::atomic<bool>* cancel = nullptr);

}  // namespace braid
