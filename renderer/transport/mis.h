// SPDX-License-Identifier: Apache-2.0
// Multiple importance sampling weights (Veach 1997, chapter 9).
#pragma once

#include <cmath>

namespace braid {

// Power heuristic with exponent 3/2, between Veach's 2 and the balance heuristic, for the technique with density `pdf`
// against one other; the ratio form does not overflow. No scene has more noise by it than by 2, as
// some have by the balance heuristic (combiners/EXPERIMENTS.md, Weights of light and surface).
inline float powerHeuristic(float pdf, float otherPdf) {
  if (!(pdf > 0)) return 0;
  const float ratio = otherPdf / pdf;
  return 1 / (1 + ratio * std::sqrt(ratio));
}

}  // namespace braid
