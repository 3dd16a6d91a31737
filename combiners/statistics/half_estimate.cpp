// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/half_estimate.h"

#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/finite_float.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

Rgb<float> scaled(const Rgb<float>& image, double k) {
  Rgb<float> out(image.width(), image.height(), kUnfilled);
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) out[c][i] = finiteFloat(k * static_cast<double>(image[c][i]));
    });
  return out;
}

}  // namespace

bool hasHalfEstimates(const Estimate& e, const GivenQuarters& quarters) {
  return hasHalves(e) && (e.passes == 0 || e.passes >= 4) && quarters.images && quarters.images->size() == 4;
}

Estimate halfEstimate(const Estimate& e, const GivenQuarters& quarters, int h) {
  Estimate half;
  half.name = e.name;
  half.passes = (e.passes + (h == 0 ? 1 : 0)) / 2;
  half.mean = e.half[h];
  half.variance = halfVariance(e, meanVariance(e), h);
  for (size_t k = 0; k < 2; ++k)
    half.half[k] = scaled((*quarters.images)[static_cast<size_t>(h) + 2 * k], quarters.scale);
  return half;
}

}  // namespace braid
