// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/direct_light.h"

#include <utility>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

DirectLightAccumulator::DirectLightAccumulator(int width, int height, int buckets, KeptSquares squares)
    : direct_(width, height, buckets, false, squares), indirectSquares_(direct_.squares()) {}

void DirectLightAccumulator::commit(uint64_t pass, const PassTarget& target, bool counts) {
  BRAID_ASSERT(target.wantsDirect());  // its splats, if any, are those of other integrators
  Rgb<double>& squares = indirectSquares_[pass % indirectSquares_.size()];
  target.forEachRun([&](size_t begin, size_t count) {
    direct_.commitRun(pass, target.direct_, begin, count);
    for (size_t c = 0; c < 3; ++c) {
      const float *own = target.own_[c].data.data(), *direct = target.direct_[c].data.data();
      double* sumsq = squares[c].data.data();
      for (size_t i = begin; i < begin + count; ++i)
        sumsq[i] += sqr(static_cast<double>(own[i]) - static_cast<double>(direct[i]));
    }
  });
  if (counts) direct_.countPass(pass);
}

DirectLight DirectLightAccumulator::directPart(bool lowDiscrepancy) const {
  return {direct_.mean(), {direct_.halfMean(0), direct_.halfMean(1)}, direct_.variance(lowDiscrepancy)};
}

Rgb<float> DirectLightAccumulator::indirectVariance(const Accumulator& whole, bool lowDiscrepancy) const {
  return indirect(whole).variance(lowDiscrepancy);
}

Accumulator DirectLightAccumulator::indirect(const Accumulator& whole) const {
  std::vector<Rgb<double>> sums = whole.sums();
  std::vector<uint64_t> counts;
  for (size_t k = 0; k < sums.size(); ++k) {
    counts.push_back(whole.passesInBucket(static_cast<int>(k)));
    for (size_t c = 0; c < 3; ++c)
      parallelChunks(sums[k].size(), kPixelChunk, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) sums[k][c][i] -= direct_.sums()[k][c][i];
      });
  }
  return Accumulator::fromSums(std::move(sums), indirectSquares_, std::move(counts));
}

}  // namespace braid
