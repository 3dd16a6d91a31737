// SPDX-License-Identifier: Apache-2.0
// What the header of an image file may claim before anything is allocated for it.
#pragma once

#include <cstdint>

namespace braid {

// Whether a file of so many bytes can hold so many values. No format packs a flat picture tighter than one-bit pixels
// under deflate, 8 x 1032 to the byte; twice that is allowed, and 2^20 values always are.
inline bool canHold(uint64_t fileBytes, uint64_t values) {
  constexpr uint64_t kAlways = uint64_t(1) << 20, kMostPerByte = 16384;
  return values <= kAlways || values / kMostPerByte <= fileBytes;
}

}  // namespace braid
