// SPDX-License-Identifier: Apache-2.0
// Keeps what a filter makes of a pixel within what the pixels about it show that differ from it by noise only. Filters
// that weigh by patches average a small lamp away in the distances of patches, and smear it over its surroundings.
#pragma once

#include <span>

#include "renderer/core/plane.h"

namespace braid {

// Limits every value of images[k] to the range that values[k] has, and a tenth of its ends beyond, in the pixels of the
// window of (2 radius + 1)², clipped at the borders, that `noisy` shows darker by at most 3.5 standard deviations of
// the difference, or brighter by at most 2, channel by channel: a lamp that half of the samples of its pixel see would
// else light what is beside it (combiners/EXPERIMENTS.md, Range of alike pixels). A pixel that is alike to none
// other is one whose samples have missed the light, not one beside a lamp: then brighter is 3.5, too. `variance` is
// that of `noisy`. All are finite and of one size.
void clampToLocalRange(std::span<Rgb<float>* const> images, std::span<const Rgb<float>* const> values,
                       const Rgb<float>& noisy, const Rgb<float>& variance, int radius);

}  // namespace braid
