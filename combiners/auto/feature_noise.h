// SPDX-License-Identifier: Apache-2.0
// Noise of the features in images of few samples (combiners/auto/auto.md). A sample sees one of the surfaces that share
// a pixel: edges are jagged, hair and leaves are speckled, and filters, which tell surfaces apart by their features,
// take this for detail.
#pragma once

#include <atomic>

#include "renderer/film/estimates.h"

namespace braid {

// Averages the pixels of the image and of its halves with their neighbours, each by the share m / (m + 0.005) times
// `own` (in [0, 1]; empty: 1). d(k) is the squared difference of a pixel's features, albedo and a quarter of the
// normal, to those of its two neighbours along direction k of four, mean of both; environments are all alike. m is the
// least d: along a clean edge nothing differs. From two passes on it is at most 2 / `passes` times the variance of the
// features, mean over 3x3 pixels: what differs by more is detail. Neighbours weigh as in 1 2 1 along both axes, times
// ((D + 0.01) / (D(k) + 0.01))³, D(k) the mean of d(k) over 5x5 pixels and D the least of them: stripes are averaged
// lengthwise. No channel changes by more than the mean of the channels, or than 0.02 where that is less. Does nothing
// without normals and albedo of the size of the image, nor, from two passes on, without their variance.
void averageFeatureNoise(Estimate& image, const Features* features, uint64_t passes, const Plane<float>& own,
                         const std::atomic<bool>* cancel = nullptr);

}  // namespace braid
