// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/direct_indirect.h"

#include "renderer/core/parallel.h"

namespace braid {

namespace {

void addScaled(Rgb<float>& to, float factor, const Rgb<float>& from) {
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(to.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) to[c][i] += factor * from[c][i];
    });
}

Estimate headOf(const Estimate& e) {
  Estimate out;
  static_cast<EstimateHead&>(out) = e;
  return out;
}

}  // namespace

bool hasDirectIndirect(const Estimate& e) {
  return !e.direct.mean.empty() && !e.direct.half[0].empty() && !e.direct.half[1].empty() &&
         !e.direct.variance.empty() && !e.indirectVariance.empty() && !e.half[0].empty() && !e.half[1].empty();
}

Estimate directLight(const Estimate& e) {
  Estimate out = headOf(e);
  out.mean = e.direct.mean;
  for (size_t h = 0; h < 2; ++h) out.half[h] = e.direct.half[h];
  out.variance = e.direct.variance;
  return out;
}

Estimate indirectLight(const Estimate& e) {
  Estimate out = headOf(e);
  out.mean = e.mean;
  addScaled(out.mean, -1, e.direct.mean);
  for (size_t h = 0; h < 2; ++h) {
    out.half[h] = e.half[h];
    addScaled(out.half[h], -1, e.direct.half[h]);
  }
  out.variance = e.indirectVariance;
  return out;
}

void addImage(Estimate& to, const Estimate& from) {
  addScaled(to.mean, 1, from.mean);
  for (size_t h = 0; h < 2; ++h) addScaled(to.half[h], 1, from.half[h]);
}

}  // namespace braid
