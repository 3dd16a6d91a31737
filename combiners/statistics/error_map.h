// SPDX-License-Identifier: Apache-2.0
// How far an estimate is from the truth, from what it knows about itself: variance plus squared bias.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// The squared bias of the mean, per pixel and channel average: max(0, F(B² - Var B)), F the average over 13 x 13 pixels
// (integrators/README.md, Bias of photon maps). Squares are averaged rather than biases, because these change their
// sign from pixel to pixel along edges. Zero for estimates without a bias plane.
Plane<float> squaredBias(const Estimate& estimate);

// Whether there are passes and a variance to estimate an error by.
bool knowsError(const Estimate& estimate);

// Estimated squared error of the mean, averaged over the channels: variance + squaredBias().
Plane<float> errorMap(const Estimate& estimate);

}  // namespace braid
