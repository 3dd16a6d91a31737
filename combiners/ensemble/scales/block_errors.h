// SPDX-License-Identifier: Apache-2.0
// Products of the errors of candidates, measured across halves and averaged over blocks of pixels.
#pragma once

#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

inline constexpr int kErrorBlock = 4;  // pixels along the side of a block; smaller at the right and lower border

// Where the pair (i, j) of candidates stands in a list of pairs, j <= i.
inline size_t pairIndex(size_t i, size_t j) { return i * (i + 1) / 2 + j; }

// For every pair of candidates a plane of blocks: the means over a block's pixels and the sums over channels of
// e_i e_j, with
//   e_i = box2x2((y_i - x) roots),
// y_i the half `half` of a candidate and x the other half of the unbiased image, which y_i has not seen. Its
// expectation is the product of the relative errors of the halves, plus the noise of x, which is the same in every
// entry. The box takes noise of single pixels off; errors that spread over some pixels stay. All images have halves.
std::vector<Plane<float>> blockErrors(const Estimate& x, const std::vector<const Estimate*>& candidates,
                                      const Plane<float>& roots, int half);

}  // namespace braid
