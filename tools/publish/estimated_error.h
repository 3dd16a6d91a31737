// SPDX-License-Identifier: Apache-2.0
// The relative error that a render tells of itself: relL2 of `braid compare`, as well as it can be known without the
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

// u of a noisy estimate. The variance v is shared out to the halves A and B by the squares of their values, and what
// belongs to one is divided by a level that has not seen it:
//   1 / u = share_A / (T_A² + 0.01) + share_B / (T_B² + 0.01),
//   T_A² = max((N_A + R_A)², x² - 3 v),   N_A = max(M_1, M_2),
//   M_r = mean of {B at the pixel, both halves at the others of (2r + 1)² pixels},
// and T_B likewise. A pixel that one of its halves alone finds bright may be a firefly on a dark wall or the edge of a
// small lamp: its neighbours tell the two apart, and the brighter of two windows is the one that a lamp fills. Where
// more than three samples speak for its value x, x² - 3 v does.
// R_A is 0 unless half A is beyond 16 N_A, a firefly. Light may come by rare samples there, as in caustics, which most
// of the neighbours have not met: R_A is what fireflies have beyond their N, averaged over the smallest window without
// the pixel, of r in {1, 2, 4, 8, 16}, that holds three of them, or over that of 16.
// What no sample has met nobody can know; then the image does not hold the firefly either, which would be most of its
// error.
Plane<float> squaredLevels(const Estimate& noisy);

// u of an image whose fireflies are gone, as combiners leave it: by its own values.
Plane<float> squaredLevels(const Rgb<float>& image);

// Mean of error / squaredLevels; pixels that are not finite are left out.
double relativeError(const Plane<float>& error, const Plane<float>& squaredLevels);

}  // namespace braid
