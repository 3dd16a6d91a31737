// SPDX-License-Identifier: Apache-2.0
// Features freed of their noise before a regression uses them (Bitterli et al. 2016, "Nonlinearly Weighted First-order
// Regression for Denoising Monte Carlo Renderings", 5.1): a regression takes noise in its features for signal.
//
// Every scalar channel is filtered by itself with non-local means. Weights of a half come from the other half, so that
// its noise cannot choose them.
#pragma once

#include <vector>

#include "combiners/regression/regression.h"
#include "renderer/film/estimates.h"

namespace braid {

// Scalar feature channels with the groups that share a scale: albedo, normal, depth, visibility, as far as they are
// there and vary over the image. Movable; groups() points into it.
struct FeatureChannels {
  std::vector<Plane<float>> planes;
  std::vector<size_t> groupSizes;  // 3 or 1, in order; they add up to the number of planes
  bool hasAlbedo = false;          // then it is the first group
  std::vector<FeatureGroup> groups() const;
  // Three planes, or null.
  const Plane<float>* albedo() const { return hasAlbedo ? planes.data() : nullptr; }
};

// Half A and half B of the same channels.
struct FeatureHalves {
  FeatureChannels half[2];
};

// A filtered with weights of B and vice versa: windows of 11x11, patches of 7x7, k = 0.5. Depth is in units of its
// 99.9th percentile. Non-finite values count as 0. Channels without halves are taken as they are; without a variance it
// comes from the halves. Null: no channels.
FeatureHalves crossPrefiltered(const Features* features);

// The mean of prefiltered halves, filtered once more by itself with the variance (A - B)² / 4: windows of 5x5, patches
// of 7x7, k = 0.5.
FeatureChannels prefilteredMean(const FeatureHalves& halves);

}  // namespace braid
