// SPDX-License-Identifier: Apache-2.0
// Removes outliers that have gone through a combination, where one sample, and nothing else, speaks for them.
#pragma once

#include <cstdint>
#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

// A pixel that is replaced, and by what.
struct Spike {
  size_t index = 0;
  Spectrum replacement{0};
};

// The spikes of `image` (ALGORITHMS-BEYOND 8.3, step 6). A pixel is one if
//   - the standard deviation of the unbiased mean, sqrt(mean_RGB v), is above 8 times its mean over 15x15 pixels;
//   - the image is brighter there than all of its 5x5 neighbours that are no candidates and lie on the same surface,
//   and
//     than the mean that would replace it;
//   - the two darkest quarters of the unbiased estimate show less than 0.3 of the excess over the neighbours' mean:
//     an outlier lives in one or two quarters, a thin lamp in all four.
// The replacement is the mean of those neighbours, weighted by nearness and by likeness in albedo and normal. The third
// condition makes it vanish as samples grow: what is there shows in every quarter. Needs the four quarters of the
// unbiased estimate; without them there are no spikes.
std::vector<Spike> findSpikes(const Rgb<float>& image, const Estimate& unbiased, const Rgb<float>& variance,
                              const Features* features);

// Writes the replacements into an image.
void replaceSpikes(Rgb<float>& image, const std::vector<Spike>& spikes);

}  // namespace braid
