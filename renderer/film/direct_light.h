// SPDX-License-Identifier: Apache-2.0
// The two parts of an integrator's light, direct and indirect (Estimate::direct), summed apart: filters see shadow
// edges and textures of lights in the one, and the smooth rest without them in the other.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// Beside the Accumulator of the whole, which holds the sums of both parts. 144 bytes a pixel with four buckets, 96 with
// two.
class DirectLightAccumulator {
 public:
  DirectLightAccumulator(int width, int height, int buckets);

  // Adds the pass' direct light, and the square of what is left of its value.
  void commit(uint64_t pass, const PassTarget& target);

  DirectLight directPart(bool lowDiscrepancy) const;
  // Of the mean of the rest; `whole` holds the same passes.
  Rgb<float> indirectVariance(const Accumulator& whole, bool lowDiscrepancy) const;

  // For state files: what a file holds, and back.
  void listSums(const std::string& name, RawSums& list);
  void setCounts(std::vector<uint64_t> counts) { direct_.setCounts(std::move(counts), 0, 0); }
  const Accumulator& direct() const { return direct_; }
  const Rgb<double>& indirectSumOfSquares() const { return indirectSumsq_; }
  void addCounts(const DirectLightAccumulator& other) { direct_.addCounts(other.direct_); }

 private:
  Accumulator direct_;
  Rgb<double> indirectSumsq_;
};

}  // namespace braid
