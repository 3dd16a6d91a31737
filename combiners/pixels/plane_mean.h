// SPDX-License-Identifier: Apache-2.0
// The mean of a plane's values, the same bits for any number of threads.
#pragma once

#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"

namespace braid {

// 0 for an empty plane.
inline double planeMean(const Plane<float>& plane) {
  const double sum = parallelSum(plane.size(), kPixelChunk, 0.0, [&](size_t begin, size_t end) {
    double part = 0;
    for (size_t i = begin; i < end; ++i) part += static_cast<double>(plane[i]);
    return part;
  });
  return plane.empty() ? 0 : sum / static_cast<double>(plane.size());
}

}  // namespace braid
