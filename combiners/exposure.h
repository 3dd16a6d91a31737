// SPDX-License-Identifier: Apache-2.0
// What is done to estimates once before any method sees them: bad values are removed, and colours are scaled to a
// radiance of order 1, because the constants in the papers (an epsilon of 0.01, a grid of gammas) assume it. Scenes in
// physical light units are many orders of magnitude away from that.
#pragma once

#include <cstdint>

#include "renderer/film/combiner.h"

namespace braid {

// The factor that brings the image to middle grey: the image is cut into tiles of at most 16x16 pixels, and
// k = 0.18 / 2^(mean of log2 of the tiles' luminances), the rule of Open Image Denoise. Tiles darker than 10⁻⁸ of the
// brightest one do not count: a limit relative to the image, so that k is exactly inverse to the light. 1 for images
// without light. Non-finite pixels count as black.
double exposureScale(const Rgb<float>& image);

struct SanitiseReport {
  uint64_t nonFinite = 0;         // values set to 0
  uint64_t negativeVariance = 0;  // values set to 0
  uint64_t outOfRange = 0;        // values moved to the limit
  bool clean() const { return nonFinite == 0 && negativeVariance == 0 && outOfRange == 0; }
};

// Sets every non-finite value to 0, and every negative variance.
SanitiseReport sanitise(Estimate& estimate);
SanitiseReport sanitise(Estimates& estimates);

// Moves normalised colours and features beyond ±10⁹ to that limit, and variances beyond its square, so that fourth
// powers stay within floats. The sun in a dark room is below it. Returns how many.
uint64_t limitRange(Estimates& estimates);

// Multiplies colours and biases by k, variances and squared errors by k².
void scaleExposure(Estimate& estimate, double k);
void scaleExposure(Estimates& estimates, double k);
void scaleExposure(MethodResult& result, double k);

}  // namespace braid
