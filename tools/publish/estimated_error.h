// SPDX-License-Identifier: Apache-2.0
// The estimated relative error of a render: relL2 of `braid compare`, as well as it can be known without the
// reference,
//
//   mean over pixels of  E / u,   u = T² + 0.01,
//
// where E is the estimated squared error of the pixel (the mean of its channels) and T what the pixel converges to (the
// mean of its channels). E, a variance, knows a firefly for what it is: the firefly is its own error. T must not, or
// each would hide itself: divided by its own square it counts as 1 at most, however large it is.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// u of a noisy estimate: what belongs to a half is divided by a level that this half has not seen (tools/README.md,
// Estimated error).
Plane<float> squaredLevels(const Estimate& noisy);

// u of an image whose fireflies are gone, as combiners leave it: by its own values.
Plane<float> squaredLevels(const Rgb<float>& image);

// Mean of error / squaredLevels; pixels that are not finite are left out.
double relativeError(const Plane<float>& error, const Plane<float>& squaredLevels);

}  // namespace braid
