// SPDX-License-Identifier: Apache-2.0
// Keeps what a filter makes of a pixel within what the pixels about it show that differ from it by noise only. Filters
// that weigh by patches average a small lamp away in the distances of patches, and smear it over its surroundings.
#pragma once

#include <span>

#include "renderer/core/plane.h"

namespace braid {

// Limits every value of images[k] to the range that values[k] has in the pixels of the window of (2 radius + 1)²,
// clipped at the borders, that `noisy` tells apart from the pixel by at most 3.5 standard deviations of their
// difference, channel by channel. `variance` is that of `noisy`. All are finite and of one size.
void keepInAlikeRange(std::span<Rgb<float>* const> images, std::span<const Rgb<float>* const> values,
                      const Rgb<float>& noisy, const Rgb<float>& variance, int radius);

}  // namespace braid
