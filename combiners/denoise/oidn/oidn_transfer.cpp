// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/oidn/oidn_transfer.h"

#include <algorithm>
#include <cmath>

namespace braid {

namespace {

// Linear, power, logarithm; radiance and value where one ends and the next begins.
constexpr float kA = 1.41283765e+03f, kB = 1.64593172f, kC = 4.31384981e-01f, kD = -2.94139609e-03f,
                kE = 1.92653254e-01f, kF = 6.26026094e-03f, kG = 9.98620152e-01f;
constexpr float kRadiance0 = 1.57945760e-06f, kRadiance1 = 3.22087631e-02f;
constexpr float kValue0 = 2.23151711e-03f, kValue1 = 3.70974749e-01f;

// Of what networks may make of strange weights, as of all normalised colours.
constexpr float kMostDecoded = 1e9f;

float encoded(float radiance) {
  if (radiance <= kRadiance0) return kA * radiance;
  if (radiance <= kRadiance1) return kB * std::pow(radiance, kC) + kD;
  return kE * std::log(radiance + kF) + kG;
}

float decoded(float value) {
  if (value <= kValue0) return value / kA;
  if (value <= kValue1) return std::pow((value - kD) / kB, 1 / kC);
  return std::exp((value - kG) / kE) - kF;
}

float scale() {
  static const float one = encoded(kOidnMostRadiance);
  return one;
}

}  // namespace

float oidnEncoded(float radiance) {
  return radiance > 0 ? encoded(std::min(radiance, kOidnMostRadiance)) / scale() : 0.0f;
}

float oidnDecoded(float value) { return value > 0 ? std::min(decoded(value * scale()), kMostDecoded) : 0.0f; }

}  // namespace braid
