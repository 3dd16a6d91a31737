// SPDX-License-Identifier: Apache-2.0
// The feature planes of a regression: albedo, normal, depth and visibility, of a half or of all samples.
#pragma once

#include <vector>

#include "combiners/regression/regression.h"
#include "renderer/film/estimates.h"

namespace braid {

enum class Samples { HalfA, HalfB, All };

// Owns the scaled depth; the groups point into it and into `features`, which must outlive them.
class RegressionFeatures {
 public:
  // Null: no features at all. Depth is divided by one number for both halves and their mean, the 99.9th percentile of
  // the mean: a single distant pixel does not flatten all others, and misses have depth 0.
  RegressionFeatures(const Features* features, Samples samples);
  // Groups that do not vary over the image are left out: they cannot change a fit.
  std::vector<FeatureGroup> groups() const;

 private:
  const Features* features_;
  Samples samples_;
  Plane<float> depth_;
};

}  // namespace braid
