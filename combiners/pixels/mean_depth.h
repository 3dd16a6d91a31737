// SPDX-License-Identifier: Apache-2.0
// The unit of depths: filters compare those of scenes of any size.
#pragma once

#include <cmath>

#include "renderer/core/plane.h"

namespace braid {

// 1 over the mean of the depths above 0, which are of what was hit; 0 where nothing was.
inline float inverseMeanDepth(const Plane<float>& depth) {
  double sum = 0, count = 0;
  for (const float d : depth.data)
    if (std::isfinite(d) && d > 0) {
      sum += static_cast<double>(d);
      ++count;
    }
  return sum > 0 ? static_cast<float>(count / sum) : 0.0f;
}

}  // namespace braid
