// SPDX-License-Identifier: Apache-2.0
// How the networks beside shrinkage see images and errors: by logarithms, of order 1 whatever the light. Training reads
// the same planes (tools/train).
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "combiners/learned/planes/plane_network.h"

namespace braid {

inline float compressedRadiance(float radiance) { return 0.5f * std::log1p(4 * std::max(radiance, 0.0f)); }

// The root of an error against the brightness it is an error of.
inline float compressedError(float squaredError, float level) {
  return 0.25f * std::log2(std::sqrt(std::max(squaredError, 0.0f)) / (std::max(level, 0.0f) + 0.01f) + 0.002f);
}

// The method's network, with numbers for `kernels` windows of this radius and one more a pixel; the library is opened.
// Throws Error where there is none.
struct ShrinkageNetwork {
  std::unique_ptr<PlaneNetwork> network;
  int across;  // cells of a window
};
ShrinkageNetwork openShrinkageNetwork(const std::string& method, int planes, int kernels, int radius);

}  // namespace braid
