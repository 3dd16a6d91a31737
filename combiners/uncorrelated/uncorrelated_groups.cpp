// SPDX-License-Identifier: Apache-2.0
#include "combiners/uncorrelated/uncorrelated_groups.h"

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/finite_float.h"

namespace braid {

Plane<float> halvesVariance(const Rgb<float> (&halves)[2]) {
  Plane<float> out(halves[0].width(), halves[0].height());
  for (size_t i = 0; i < out.size(); ++i) {
    double sum = 0;
    for (size_t c = 0; c < 3; ++c)
      sum += sqr(static_cast<double>(halves[0][c][i]) - static_cast<double>(halves[1][c][i])) / 12;
    out[i] = finiteFloat(sum);
  }
  const Plane<double> mean = boxMean(out, 3);
  for (size_t i = 0; i < out.size(); ++i) out[i] = finiteFloat(mean[i]);
  return out;
}

}  // namespace braid
