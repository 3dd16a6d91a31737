// SPDX-License-Identifier: Apache-2.0
// Estimates of a film whose pixels differ in their numbers of samples (renderer/README.md, Placement of samples): the
// mean is that of the two half means, whatever their numbers, as these depend on the values of the other half.
#pragma once

#include "renderer/film/film.h"
#include "renderer/film/sample_placement.h"

namespace braid {

// Views of sums with four buckets and the squares of halves, which must outlive this.
class PlacedSums {
 public:
  PlacedSums(const Accumulator& sums, const SamplePlacement& placement);

  Rgb<float> mean() const;
  Rgb<float> halfMean(int half) const;
  Rgb<float> bucketMean(int k) const;
  // Of the mean, (s_A²/n_A + s_B²/n_B)/4, and of the mean of a half; calibrated as Accumulator::variance() is.
  Rgb<float> variance(bool lowDiscrepancy) const;
  Rgb<float> halfVariance(int half, bool lowDiscrepancy) const;

 private:
  double meanOfHalf(size_t c, size_t i, size_t tile, int half) const;
  double withinHalf(size_t c, size_t i, size_t tile, int half) const;
  double betweenBuckets(size_t c, size_t i, size_t tile, int half) const;
  template <class Within, class Between, class Samples>
  Rgb<float> calibrated(const Within& within, const Between& between, const Samples& samples, double groups) const;

  const Accumulator& sums_;
  const SamplePlacement& placement_;
};

// The features' means, those of their halves, and the variance of the mean, by the numbers of samples of the tiles.
class PlacedFeatures {
 public:
  PlacedFeatures(const FeatureAccumulator& features, const SamplePlacement& placement)
      : features_(features), placement_(placement) {}
  Plane<float> mean(int component) const;
  Plane<float> halfMean(int component, int half) const;
  Plane<float> variance(int component) const;

 private:
  const FeatureAccumulator& features_;
  const SamplePlacement& placement_;
};

}  // namespace braid
