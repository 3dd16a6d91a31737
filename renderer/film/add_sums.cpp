// SPDX-License-Identifier: Apache-2.0
// Adds the sums of other passes to accumulators, plane by plane.
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/film.h"

namespace braid {

namespace {

void addPlane(Plane<double>& to, const Plane<double>& from) {
  BRAID_ASSERT(to.width == from.width && to.height == from.height);
  parallelChunks(to.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) to[i] += from[i];
  });
}

void addPlanes(Rgb<double>& to, const Rgb<double>& from) {
  for (size_t c = 0; c < 3; ++c) addPlane(to[c], from[c]);
}

void addPlanes(std::vector<Plane<double>>& to, const std::vector<Plane<double>>& from) {
  BRAID_ASSERT(to.size() == from.size());
  for (size_t c = 0; c < to.size(); ++c) addPlane(to[c], from[c]);
}

}  // namespace

void Accumulator::add(const Accumulator& other) {
  BRAID_ASSERT(sum_.size() == other.sum_.size() && keepsBias() == other.keepsBias());
  for (size_t k = 0; k < sum_.size(); ++k) {
    addPlanes(sum_[k], other.sum_[k]);
    count_[k] += other.count_[k];
  }
  addPlanes(sumsq_, other.sumsq_);
  if (keepsBias()) {
    for (size_t h = 0; h < 2; ++h) addPlanes(biasSum_[h], other.biasSum_[h]);
    addPlanes(biasSumsq_, other.biasSumsq_);
  }
  rejected_ += other.rejected_;
  clampedSplats_ += other.clampedSplats_;
}

void FeatureAccumulator::add(const FeatureAccumulator& other) {
  for (size_t h = 0; h < 2; ++h) {
    addPlanes(sum_[h], other.sum_[h]);
    count_[h] += other.count_[h];
  }
  addPlanes(sumsq_, other.sumsq_);
}

void CoverageAccumulator::add(const CoverageAccumulator& other) {
  addPlane(sum_, other.sum_);
  count_ += other.count_;
}

CoverageAccumulator CoverageAccumulator::fromSums(Plane<double> sums, uint64_t passes) {
  CoverageAccumulator a(0, 0);
  a.sum_ = std::move(sums);
  a.count_ = passes;
  return a;
}

}  // namespace braid
