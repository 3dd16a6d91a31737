// SPDX-License-Identifier: Apache-2.0
// The tone curve of the metrics.
#pragma once

#include <algorithm>

#include "renderer/core/plane.h"
#include "renderer/core/image_values.h"

namespace braid {

// The rational fit of the ACES curve (Narkowicz 2015), x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), with the
// pre-exposure 0.6 that it was fitted for; clamped to [0, 1]. Beyond 10⁶ the curve is flat, and a square could
// overflow.
inline float acesTonemap(float linear) {
  const float x = 0.6f * std::min(std::max(linear, 0.0f), 1e6f);
  return std::min(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f), 1.0f);
}

// What a viewer sees: ACES, then sRGB.
inline float displayValue(float linear) { return encodeSrgb(acesTonemap(linear)); }

}  // namespace braid
