// SPDX-License-Identifier: Apache-2.0
// Multiple importance sampling weights (Veach 1997, chapter 9).
#pragma once

namespace braid {

// Power heuristic with exponent 2 for the technique with density `pdf` against one other; the ratio form does not
// overflow.
inline float powerHeuristic(float pdf, float otherPdf) {
  if (!(pdf > 0)) return 0;
  const float ratio = otherPdf / pdf;
  return 1 / (1 + ratio * ratio);
}

}  // namespace braid
