// SPDX-License-Identifier: Apache-2.0
// The features of RDFC: brought to a common range, rid of their own noise, and with what the distances need to know.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "combiners/denoise/rdfc/rdfc_planes.h"
#include "renderer/film/estimates.h"

namespace braid {

// The variance of the mean of the halves a and b of `passes` passes, n_A n_B / n² (a - b)², smoothed lightly: weights
// exp(-2 |d|²) over 3 x 3 pixels. Of 2 passes or more.
Plane<float> rdfcHalvesVariance(const Plane<float>& a, const Plane<float>& b, uint64_t passes);

// The features that there are, in this order: normal (3 channels, (n + 1) / 2), albedo (3, divided by the largest
// component where that is above 1), depth (1, divided by the depth that one pixel in a thousand exceeds; in place of
// the world position, which is not recorded) and visibility (1). Those without variation are left out.
//
// Each is filtered by non-local means over 11 x 11 pixels with its own mean as the guide and k = 1, both halves with
// the same weights. The variance that is left is that of the filtered halves. spread = max(variance, squared gradient),
// where the gradient is over half a pixel and the smaller one of both sides along each axis.
std::vector<RdfcGuide> rdfcFeatures(const Features& features, uint64_t passes,
                                    const std::atomic<bool>* cancel = nullptr);

// The same features as they are, with their own variance, 0 where it is not known: for images that have little noise
// left.
std::vector<RdfcGuide> rdfcRawFeatures(const Features& features);

}  // namespace braid
