// SPDX-License-Identifier: Apache-2.0
// What the accumulators hold: their sums by name, added up by their lists, and their counts.
#include <utility>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/direct_light.h"
#include "renderer/film/film.h"

namespace braid {

namespace {

// One image by its name, those of halves with their letter.
void listSquares(const std::string& name, std::vector<Rgb<double>>& squares, RawSums& list) {
  if (squares.size() == 1) return listColour(name, squares[0], list);
  listColour(name + "A", squares[0], list);
  listColour(name + "B", squares[1], list);
}

}  // namespace

void addSums(const RawSums& to, const RawSums& from) {
  BRAID_ASSERT(to.size() == from.size());
  for (size_t p = 0; p < to.size(); ++p) {
    Plane<double>& sum = *to[p].plane;
    const Plane<double>& more = *from[p].plane;
    BRAID_ASSERT(to[p].name == from[p].name && sum.width == more.width && sum.height == more.height);
    parallelChunks(sum.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) sum[i] += more[i];
    });
  }
}

void Accumulator::listSums(const std::string& sum, const std::string& squares, RawSums& list) {
  for (size_t k = 0; k < sum_.size(); ++k) listColour(sum + std::to_string(k), sum_[k], list);
  listSquares(squares, squares_, list);
}

void Accumulator::listBias(const std::string& bias, RawSums& list) {
  if (!keepsBias_) return;
  listColour(bias + "A", biasSum_[0], list);
  listColour(bias + "B", biasSum_[1], list);
  listColour(bias + "Squares", biasSumsq_, list);
}

void Accumulator::setCounts(std::vector<uint64_t> counts, uint64_t rejected, uint64_t clampedSplats) {
  BRAID_ASSERT(counts.size() == sum_.size());
  count_ = std::move(counts);
  rejected_ = rejected;
  clampedSplats_ = clampedSplats;
}

void Accumulator::addCounts(const Accumulator& other) {
  BRAID_ASSERT(count_.size() == other.count_.size());
  for (size_t k = 0; k < count_.size(); ++k) count_[k] += other.count_[k];
  rejected_ += other.rejected_;
  clampedSplats_ += other.clampedSplats_;
}

void DirectLightAccumulator::listSums(const std::string& name, RawSums& list) {
  direct_.listSums(name + "direct", name + "directSquares", list);
  listSquares(name + "indirectSquares", indirectSquares_, list);
}

void FeatureAccumulator::listSums(const std::string& name, RawSums& list) {
  const auto part = [&](const char* what, std::vector<Plane<double>>& planes) {
    for (size_t c = 0; c < planes.size(); ++c) list.push_back({name + what + std::to_string(c), &planes[c]});
  };
  part("sumA", sum_[0]);
  part("sumB", sum_[1]);
  part("squares", sumsq_);
}

void FeatureAccumulator::setCounts(uint64_t passesA, uint64_t passesB) {
  count_[0] = passesA;
  count_[1] = passesB;
}

void FeatureAccumulator::addCounts(const FeatureAccumulator& other) {
  for (size_t h = 0; h < 2; ++h) count_[h] += other.count_[h];
}

}  // namespace braid
