// SPDX-License-Identifier: Apache-2.0
// The plain filter of RDFC, which smooths features, error maps, selection maps and, in the end, the image: patches of
// 7 x 7 pixels, weights averaged over 5 x 5, and a pixel that has the weight of its best neighbour with itself, so that
// it is replaced wherever there is anything like it.
#pragma once

#include <atomic>
#include <span>
#include <vector>

#include "combiners/denoise/rdfc/rdfc_pairs.h"

namespace braid {

struct RdfcWindowFilter {
  const RdfcGuide* guide = nullptr;  // channels of the size of the image
  float k = 1;                       // sensitivity: larger filters more
  int window = 5;                    // radius, at most 10
  rdfc::Spread spread = rdfc::Spread::Both;
  const std::vector<RdfcGuide>* features = nullptr;  // none: the guide alone
};

// Weighted means of each target with the same weights: out[i] = filtered in[i]. Deterministic; tiles stay black once
// `cancel` is set.
std::vector<Plane<float>> rdfcFiltered(const RdfcWindowFilter& filter, std::span<const MirroredPlane> in,
                                       const std::atomic<bool>* cancel = nullptr);

}  // namespace braid
