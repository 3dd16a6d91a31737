// SPDX-License-Identifier: Apache-2.0
// What is done to estimates once before any method sees them: bad values are removed, and colours are scaled to a
// radiance of order 1, because the constants in the papers (an epsilon of 0.01, a grid of gammas) assume it. Scenes in
// physical light units are many orders of magnitude away from that.
#pragma once

#include <cstdint>

#include "combiners/method.h"

namespace braid {

// The factor that brings the image to middle grey: the image is cut into tiles of at most 16x16 pixels, and
// k = 0.18 / 2^(mean of log2 of the tiles' luminances), the rule of Open Image Denoise. Tiles darker than 10⁻⁸ of the
// brightest one do not count: a limit relative to the image, so that k is exactly inverse to the light. 1 for images
// without light. Non-finite pixels count as black.
double exposureScale(const Rgb<float>& image);

struct SanitiseReport {
  uint64_t nonFinite = 0;         // values set to 0, unless they are filled
  uint64_t filled = 0;            // pixels of colours, filled from the other half or their neighbours
  uint64_t negativeVariance = 0;  // values set to 0
  uint64_t outOfRange = 0;        // values moved to the limit
  bool clean() const { return nonFinite == 0 && negativeVariance == 0 && outOfRange == 0; }
  SanitiseReport& operator+=(const SanitiseReport& other) {
    nonFinite += other.nonFinite;
    filled += other.filled;
    negativeVariance += other.negativeVariance;
    outOfRange += other.outOfRange;
    return *this;
  }
};

// Which planes a copy holds besides means, halves, variances and biases.
struct PlanesRead {
  KeptBuffers buffers = KeptBuffers::everything();
  bool reference = true;
};

// The estimates as methods see them. Non-finite values, which fillInvalid() leaves none of, and negative variances
// become 0. Colours and biases are multiplied by k, variances by k². Colours and features beyond ±10⁹ are moved to that
// limit, and variances beyond its square, so that fourth powers stay within floats; the sun in a dark room is below it.
// What was changed is added to the report.
Estimates normalised(const Estimates& estimates, double k, SanitiseReport& report, const PlanesRead& read = {});
Estimate normalised(const Estimate& estimate, double k, SanitiseReport& report, bool quarters = true,
                    bool directIndirect = true);

// Whether methods may see features, or only their means, as they are: nothing of them would be changed.
bool isSane(const Features& features, bool noise);

// Back to the units of the estimates: colours and biases are divided by k, variances and squared errors by k².
void undoExposure(MethodResult& result, double k);

}  // namespace braid
