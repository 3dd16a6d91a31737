// SPDX-License-Identifier: Apache-2.0
// Calls of NFOR on synthetic renders.
#pragma once

#include <cmath>

#include "combiners/denoise/nfor/nfor_filter.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test::nfor_cases {

inline NforResult filtered(const Case& c, const NforOptions& options = {}) {
  return nforFilter(c.pt(), c.estimates.features ? &*c.estimates.features : nullptr, options);
}

// As in the paper, but for the distance of the models.
inline NforOptions plain(int stride = 1) {
  NforOptions o;
  o.demodulate = o.offsets = false;
  o.stride = stride;
  return o;
}

inline double relativeError(const Rgb<float>& image, const Rgb<float>& truth) {
  return std::sqrt(meanSquaredError(image, truth) / meanSquaredError(Rgb<float>(truth.width(), truth.height()), truth));
}

}  // namespace braid::test::nfor_cases
