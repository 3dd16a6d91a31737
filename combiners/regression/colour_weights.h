// SPDX-License-Identifier: Apache-2.0
// Regression weights from the distance of the colours of a guide image.
#pragma once

#include "combiners/pixels/packed_rows.h"
#include "combiners/regression/regression.h"

namespace braid {

// exp(-max(0, |g_i - g_c|² - s (v_i + v_c)) / (v_i + v_c + constant)), with |.|² summed over RGB. `v` is the variance
// of the guide, summed over RGB as well: two pixels of one colour then have E|g_i - g_c|² = v_i + v_c.
class ColourWeights final : public WindowWeights {
 public:
  // James-Stein (combiners/README.md, Regression): v = 0, constant = 2 kappa + 0.01.
  ColourWeights(const Rgb<float>& guide, float constant);
  // Double shrinkage: constant 0.01; s = 0 to fit (Eq. 12), 1 to reconstruct (Eq. 17).
  ColourWeights(const Rgb<float>& guide, const Plane<float>& variance, float constant, bool subtractVariance);

  void row(int cx, int cy, int y, int x0, int x1, float* out) const override;

 private:
  PackedRows planes_;  // red, green, blue, and the variance where there is one
  float constant_;
  bool subtract_ = false;
};

}  // namespace braid
