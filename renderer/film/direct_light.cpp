// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/direct_light.h"

#include <utility>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

DirectLightAccumulator::DirectLightAccumulator(int width, int height, int buckets)
    : direct_(width, height, buckets), indirectSumsq_(width, height) {}

void DirectLightAccumulator::commit(uint64_t pass, const PassTarget& target) {
  BRAID_ASSERT(target.wantsDirect());  // its splats, if any, are those of other integrators
  direct_.commit(pass, target.direct_);
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(indirectSumsq_.size(), kPixelChunk, [&](size_t begin, size_t end) {
      const float *own = target.own_[c].data.data(), *direct = target.direct_[c].data.data();
      double* sumsq = indirectSumsq_[c].data.data();
      for (size_t i = begin; i < end; ++i)
        sumsq[i] += sqr(static_cast<double>(own[i]) - static_cast<double>(direct[i]));
    });
}

DirectLight DirectLightAccumulator::directPart(bool lowDiscrepancy) const {
  return {direct_.mean(), {direct_.halfMean(0), direct_.halfMean(1)}, direct_.variance(lowDiscrepancy)};
}

Rgb<float> DirectLightAccumulator::indirectVariance(const Accumulator& whole, bool lowDiscrepancy) const {
  std::vector<Rgb<double>> sums = whole.sums();
  std::vector<uint64_t> counts;
  for (size_t k = 0; k < sums.size(); ++k) {
    counts.push_back(whole.passesInBucket(static_cast<int>(k)));
    for (size_t c = 0; c < 3; ++c)
      parallelChunks(sums[k].size(), kPixelChunk, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) sums[k][c][i] -= direct_.sums()[k][c][i];
      });
  }
  return Accumulator::fromSums(std::move(sums), indirectSumsq_, std::move(counts), 0, 0).variance(lowDiscrepancy);
}

}  // namespace braid
