// SPDX-License-Identifier: Apache-2.0
// A quarter of the pixels, for a first picture in a quarter of the time.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// The estimates at half the width and height, rounded up: means over 2x2 pixels, at the borders over those that there
// are, and the variances of these means. Without quarters, parts of the light, history, attributes and reference.
Estimates halfSize(const Estimates& estimates);

// An image of width x height pixels from one of half the size, between whose pixels it is linear.
Rgb<float> doubleSize(const Rgb<float>& image, int width, int height);

}  // namespace braid
