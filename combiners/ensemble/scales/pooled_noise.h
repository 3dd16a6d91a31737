// SPDX-License-Identifier: Apache-2.0
// How noisy the unbiased image is about a place, in the units in which candidates are judged.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// For every block (block_errors.h) the variance of a pixel of half of x's samples, times the square of its root: the
// mean over the block and the channels, averaged over about a hundred pixels. A pixel's own variance is too small
// wherever no firefly has fallen yet; that of its surroundings knows of them. Empty where x has no variance.
Plane<float> pooledNoise(const Estimate& x, const Plane<float>& roots);

}  // namespace braid
