// SPDX-License-Identifier: Apache-2.0
// How much of an unbiased image X to keep beside an image Y, as the halves of the samples measure it: no variance and
// no normal distribution is assumed, and Y may be made of X.
#pragma once

#include <array>

#include "renderer/film/estimates.h"

namespace braid {

// Which pixels count: those without a positive gate, or those with one.
enum class Gated { Not, Only };

// For every channel and the block of (2 radius + 1)² pixels, mirrored at the borders, around every pixel, the f in
// [0, 1] that minimises Σ u (y^A + f (x^A - y^A) - x^B)² plus the same with the halves exchanged:
//   f = Σ u (x^A - y^A) (x^B - y^A) / Σ u (x^A - y^A)²,
// 0 where X and Y agree. u is one over residualScale() of both images and of usualVariance() of x, if it has a
// variance. The noise of a half is larger than that of the whole, hence f is rather too small, and James and Stein's
// factor larger, unless Y's errors are those of X. 0 where none of the `pixels` of `gate` is in the block; it may be
// empty.
std::array<Plane<float>, 3> crossHalfShrinkage(const Estimate& x, const Rgb<float> (&y)[2], const Plane<float>& gate,
                                               int radius, Gated pixels = Gated::Not);

// How much of X to keep in pixels with a positive `gate`, 0 in the others: of what gated pixels measure, that of the
// 3x3 pixels around, with the pixel itself or without it, whichever is less, times that of the block. A lamp's mirror
// image agrees with itself near and far; two strong samples that fell into both halves of one pixel have no neighbours
// that do, and where strong samples are dense, single ones speak against them.
std::array<Plane<float>, 3> crossHalfFireflyShrinkage(const Estimate& x, const Rgb<float> (&y)[2],
                                                      const Plane<float>& gate, int radius);

}  // namespace braid
