// SPDX-License-Identifier: Apache-2.0
// Light that filters have lost (combiners/auto/auto.md). What reaches a surface by a few bright samples looks to every
// filter like noise: images of lamps behind glass or of rooms behind a door are too dark as a whole.
#pragma once

#include <optional>

#include "renderer/film/estimates.h"

namespace braid {

// The image with the light that x holds and it does not, and its halves with that of the halves of x; nothing where no
// window has lost any. Each is multiplied, channel by channel, by
//   1 + s d / y,   s = max(0, 1 - 12 V / |d|²),   between 1 and 4,
// with means over 121x121 pixels: y of the image, d of what x is brighter, V the variance of d for all samples, for
// halves too. s is the positive part of James and Stein, but that a dozen like samples have to speak for what is lost.
// Pixels of x three times as bright as the image may be lamps, whose light is none of that of their surroundings: of
// them what both halves of x show does not count, nor any whose features are unlike their neighbours'. x is as it was
// rendered, with its fireflies. Both have halves, x a variance; the features may be null.
std::optional<Estimate> withLostLight(const Estimate& image, const Estimate& x, const Features* features);

}  // namespace braid
