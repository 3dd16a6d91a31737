// SPDX-License-Identifier: Apache-2.0
// Pixels that are no colours, because a renderer divided by zero or a half float overflowed: they have no weight. A
// pixel that one half has is filled from that half, any other from its valid neighbours, so that no method sees a hole.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// Fills the values that are not finite with the mean of the valid ones among the eight neighbours, and where there are
// none with those of ever larger blocks; 0 where nothing is valid. A colour counts as invalid when one of its channels
// is. Returns how many pixels were filled.
uint64_t fillInvalid(Plane<float>& plane);
uint64_t fillInvalid(Rgb<float>& image);

// The planes of an estimate: halves from each other, the mean from its halves, then everything else from neighbours.
// Returns how many pixels of the mean or a half were invalid.
uint64_t fillInvalid(Estimate& estimate);

// All estimates with their earlier states, the features and the reference. Features are filled only in the midst of
// valid ones; elsewhere they are 0 as where a camera ray misses, which other renderers write as infinite depths and
// normals that are no numbers. Returns how many pixels of colours were invalid.
uint64_t fillInvalid(Estimates& estimates);

}  // namespace braid
