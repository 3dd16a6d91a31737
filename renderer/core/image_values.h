// SPDX-License-Identifier: Apache-2.0
// The values of image files: how many of them a file may claim before anything is allocated for it, and what those mean
// that are encoded for a display.
#pragma once

#include <cmath>
#include <cstdint>

namespace braid {

// Whether a file of so many bytes can hold so many values. No format packs a flat picture tighter than one-bit pixels
// under deflate, 8 x 1032 to the byte; twice that is allowed, and 2^20 values always are.
inline bool canHold(uint64_t fileBytes, uint64_t values) {
  constexpr uint64_t kAlways = uint64_t(1) << 20, kMostPerByte = 16384;
  return values <= kAlways || values / kMostPerByte <= fileBytes;
}

// The sRGB transfer curve (IEC 61966-2-1), both ways.
inline float encodeSrgb(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

inline float decodeSrgb(float encoded) {
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

}  // namespace braid
