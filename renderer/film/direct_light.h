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

  // Raw sums, for state files: what a file holds, and back.
  const Accumulator& direct() const { return direct_; }
  const Rgb<double>& indirectSumOfSquares() const { return indirectSumsq_; }
  static DirectLightAccumulator fromSums(Accumulator direct, Rgb<double> indirectSumOfSquares);
  // Adds the sums of other passes, of the same size and buckets.
  void add(const DirectLightAccumulator& other);

 private:
  Accumulator direct_;
  Rgb<double> indirectSumsq_;
};

}  // namespace braid
