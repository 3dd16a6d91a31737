// SPDX-License-Identifier: Apache-2.0
// What noise of the albedo leaves in an image that was filtered without it.
#pragma once

#include "renderer/film/estimates.h"
#include "renderer/film/features.h"

namespace braid {

// Filters divide by the sampled albedo a, and multiply by it again: of an image z, z² var(a) / a² of its squared error
// is noise of a (mean of the channels, of a at least what filters divide by). Both halves of z share it, so that
// nothing of it shows between them. var(a) is ¼ (a_A - a_B)² of the albedo's halves: its reported variance is 2 to 4
// times too much at edges, which low-discrepancy points sample well; without halves it is that. The sum over the image
// is meant. 0 where no surface is seen; empty without an albedo and either.
Plane<float> albedoNoise(const Rgb<float>& image, const Features* features);

}  // namespace braid
