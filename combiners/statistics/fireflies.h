// SPDX-License-Identifier: Apache-2.0
// Removes fireflies of an unbiased estimate: pixels where one sample, and nothing else, speaks for what they show.
#pragma once

#include <cstdint>
#include <vector>

#include "combiners/method.h"

namespace braid {

// A pixel that is drawn to other values, and how much of its difference to them it keeps: in what is filtered, and in
// what images are judged by.
struct Firefly {
  size_t index = 0;
  Spectrum value{0}, variance{0};
  float kept = 0, keptByJudge = 0;
};

// The fireflies of an unbiased image, before filters spread them over their neighbours (combiners/README.md,
// Fireflies). A pixel is one if
//   - its standard deviation, sqrt(mean_RGB v), is above 8 times the mean of these over 15x15 pixels;
//   - it is brighter than all of its 5x5 neighbours that are no candidates and lie on the same surface, and than the
//     mean that would replace it;
//   - its two darkest quarters, or without quarters its darker half, show less than 0.3 of the excess over the
//     neighbours' mean: a firefly lives in one or two quarters, a thin lamp in all four.
// Value and variance are replaced by the means of those neighbours, weighted by nearness and by likeness in albedo and
// normal. The third condition makes fireflies vanish as samples grow: what is there shows in every quarter. Where many
// share a neighbourhood they are its light: those with features like their neighbours' keep max(0, 1 - 12 / K) of what
// they exceed these by, with K = (sum e)² / sum e² of the excesses e in 41x41 pixels, the number of like fireflies;
// where images are judged max(0, 1 - 3 / K). Without halves there are none. The features may be null.
std::vector<Firefly> findFireflies(const Estimate& estimate, const GivenQuarters& quarters, const Features* features);

// What denoisers read of the estimate, its mean, halves and variance, with the fireflies replaced.
Estimate withoutFireflies(const Estimate& estimate, const GivenQuarters& quarters, const Features* features);

// What an estimate holds of a pixel.
struct PixelValues {
  size_t index = 0;
  Spectrum mean{0}, half[2] = {Spectrum(0), Spectrum(0)}, variance{0};
};

// Replaces the fireflies of an estimate with halves; returns what was there.
std::vector<PixelValues> removePixels(Estimate& estimate, const std::vector<Firefly>& fireflies);
// Of those pixels what images are judged by.
std::vector<PixelValues> judgingPixels(std::vector<PixelValues> before, const std::vector<Firefly>& fireflies);
// Exchanges pixels of an estimate with halves and these, so that a second call takes the first one back.
void swapPixels(Estimate& estimate, std::vector<PixelValues>& pixels);

// Writes the replacements into an image or into a variance.
void replaceValues(Rgb<float>& image, const std::vector<Firefly>& fireflies);
void replaceVariances(Rgb<float>& variance, const std::vector<Firefly>& fireflies);

}  // namespace braid
