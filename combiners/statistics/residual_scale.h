// SPDX-License-Identifier: Apache-2.0
// In what squared differences of noisy images are measured, where sums over windows are to speak for every pixel.
#pragma once

#include "renderer/core/plane.h"

namespace braid {

// Which pixels of the window have a say in the level of its centre: all, or those whose noise is at most 8 times as
// large or as small, so that a lamp's mirror image does not raise the level of the dark beside it.
enum class LevelOf { Window, AlikeInNoise };

// sqrt(noise) sqrt(level² + 0.01), positive: of the level alone, a lamp decides about the dark beside it; of the noise
// alone, one whose samples are rare and strong does. `noise` is a variance without fireflies (empty: 1). The level is
// the squared mean root of the images a and b, of order 1, over 7x7 pixels, mirrored at the borders: fireflies count
// for little more than what they hide. All of one size.
Plane<double> residualScale(const Plane<float>& a, const Plane<float>& b, const Plane<float>& noise,
                            LevelOf of = LevelOf::Window);

}  // namespace braid
