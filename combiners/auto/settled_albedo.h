// SPDX-License-Identifier: Apache-2.0
// Noise of the albedo in combined images (combiners/auto/auto.md). Filters divide by the albedo that the samples of a
// pixel met and multiply by it again: where these meet several surfaces by chance, as through glass, which they enter
// or are reflected from, or among hair, its noise stays.
#pragma once

#include <atomic>

#include "renderer/film/estimates.h"

namespace braid {

// Multiplies the image and its halves, channel by channel, by the filtered albedo over that of the samples, both 0.03
// at least: that of the patch-Welch filter over 4 pixels, z = 1.6, guided by normals, with the albedo's own variance of
// `passes` passes, at least 2, which single pixels lend to no other. 1 on emitters and misses. No value changes by more
// than two standard deviations of the samples, whose variance `variance` is: what they know is left. Does nothing
// without the albedo's variance, or where it is zero all over. Leaves the image as it is once `cancel` is set.
void settleAlbedo(Estimate& image, const Rgb<float>& variance, const Features* features, uint64_t passes,
                  const std::atomic<bool>* cancel = nullptr);

}  // namespace braid
