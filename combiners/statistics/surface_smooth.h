// SPDX-License-Identifier: Apache-2.0
// Smooths maps of squared errors along surfaces: a box whose pixels weigh by their likeness in albedo and normal.
#pragma once

#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

// Weighted means over (2 radius + 1)² pixels clipped at the borders, weights exp(-|da|² / (2 0.25²) - |dn|² / (2
// 0.15²)) of the mean albedo and normal (combiners/README.md, Weight bilateral), the same for all planes. Plain box
// means where there are no features.
std::vector<Plane<float>> surfaceSmooth(const std::vector<const Plane<float>*>& planes, const Features* features,
                                        int radius);

}  // namespace braid
