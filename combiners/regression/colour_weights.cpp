// SPDX-License-Identifier: Apache-2.0
#include "combiners/regression/colour_weights.h"

#include "combiners/pixels/simd.h"

namespace braid {

ColourWeights::ColourWeights(const Rgb<float>& guide, float constant)
    : planes_({&guide[0], &guide[1], &guide[2]}), constant_(constant) {}

ColourWeights::ColourWeights(const Rgb<float>& guide, const Plane<float>& variance, float constant,
                             bool subtractVariance)
    : planes_({&guide[0], &guide[1], &guide[2], &variance}), constant_(constant), subtract_(subtractVariance) {}

void ColourWeights::row(int cx, int cy, int y, int x0, int x1, float* out) const {
  const float* centre = planes_.row(0, cy) + cx;
  const float* in = planes_.row(0, y) + x0;
  const size_t pitch = planes_.pitch();
  const bool varied = planes_.planes() == 4;
  const float red = centre[0], green = centre[pitch], blue = centre[2 * pitch];
  const float variance = varied ? centre[3 * pitch] : 0.0f;
  const FloatLanes scale = -1.0f / broadcastLanes(constant_);
  for (int x = 0; x < x1 - x0; x += kLanes, in += kLanes) {
    const FloatLanes r = loadLanes(in) - red, g = loadLanes(in + pitch) - green, b = loadLanes(in + 2 * pitch) - blue;
    const FloatLanes distance = r * r + g * g + b * b;
    if (!varied) {
      storeLanes(out + x, expNegative(distance * scale));
      continue;
    }
    const FloatLanes v = loadLanes(in + 3 * pitch) + variance;
    const FloatLanes excess = subtract_ ? maxLanes(distance - v, FloatLanes{}) : distance;
    storeLanes(out + x, expNegative(-excess / (v + constant_)));
  }
}

}  // namespace braid
