// SPDX-License-Identifier: Apache-2.0
// The two parts of an integrator's light, direct and indirect (Estimate::direct), summed apart: filters see shadow
// edges and textures of lights in the one, and the smooth rest without them in the other.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// Beside the Accumulator of the whole, which holds the sums of both parts. 144 bytes a pixel with four buckets, 96 with
// two; 48 more with the squares of halves.
class DirectLightAccumulator {
 public:
  DirectLightAccumulator(int width, int height, int buckets, KeptSquares squares = KeptSquares::Together);

  // Adds the pass' direct light, and the square of what is left of its value.
  void commit(uint64_t pass, const PassTarget& target, bool counts = true);

  DirectLight directPart(bool lowDiscrepancy) const;
  // Of the mean of the rest; `whole` holds the same passes.
  Rgb<float> indirectVariance(const Accumulator& whole, bool lowDiscrepancy) const;

  // For state files: what a file holds, and back.
  void listSums(const std::string& name, RawSums& list);
  void setCounts(std::vector<uint64_t> counts) { direct_.setCounts(std::move(counts), 0, 0); }
  const Accumulator& direct() const { return direct_; }
  const Rgb<double>& indirectSumOfSquares() const { return indirectSquares_[0]; }
  // The sums of the rest, whose samples are those of the whole.
  Accumulator indirect(const Accumulator& whole) const;
  void addCounts(const DirectLightAccumulator& other) { direct_.addCounts(other.direct_); }

 private:
  Accumulator direct_;
  std::vector<Rgb<double>> indirectSquares_;  // as those of the accumulator
};

}  // namespace braid
