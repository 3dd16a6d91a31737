// SPDX-License-Identifier: Apache-2.0
// UASTC's modes: how the bits of a block are divided (Khronos Data Format 1.4, "Universal ASTC").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace braid::ktx2 {

enum class Digits : uint8_t { None, Trits, Quints };

struct UastcMode {
  uint8_t code, codeBits;  // how a block begins, from its lowest bit
  uint8_t hintBits;        // of hints for other formats, behind the code
  uint8_t subsets, planes;
  uint8_t colours;  // endpoint channels: 2 luminance and alpha, 3 RGB, 4 RGBA
  Digits digits;    // what endpoints hold above their bits
  uint8_t endpointBits, weightBits;
  uint8_t patternBits;    // 0: one subset
  uint8_t componentBits;  // of the field that says which channel the second plane is for; 0: alpha
};

constexpr size_t kSolidMode = 8;

// By index; the solid mode has only a code. Mode 19 is reserved.
constexpr std::array<UastcMode, 19> kUastcModes = {{
    {0x01, 4, 15, 1, 1, 3, Digits::Trits, 6, 4, 0, 0},   // 0
    {0x35, 6, 15, 1, 1, 3, Digits::None, 8, 2, 0, 0},    // 1
    {0x1D, 5, 15, 2, 1, 3, Digits::None, 4, 3, 5, 0},    // 2
    {0x03, 5, 15, 3, 1, 3, Digits::Trits, 2, 2, 4, 0},   // 3
    {0x13, 5, 15, 2, 1, 3, Digits::Quints, 3, 2, 5, 0},  // 4
    {0x0B, 5, 15, 1, 1, 3, Digits::None, 8, 3, 0, 0},    // 5
    {0x1B, 5, 15, 1, 2, 3, Digits::Quints, 5, 2, 0, 2},  // 6
    {0x07, 5, 15, 2, 1, 3, Digits::Quints, 3, 2, 5, 0},  // 7
    {0x17, 5, 0, 0, 0, 0, Digits::None, 0, 0, 0, 0},     // 8, solid
    {0x0F, 5, 23, 2, 1, 4, Digits::None, 4, 2, 5, 0},    // 9
    {0x02, 3, 17, 1, 1, 4, Digits::Trits, 4, 4, 0, 0},   // 10
    {0x00, 2, 17, 1, 2, 4, Digits::Trits, 4, 2, 0, 2},   // 11
    {0x06, 3, 17, 1, 1, 4, Digits::Trits, 6, 3, 0, 0},   // 12
    {0x1F, 5, 23, 1, 2, 4, Digits::None, 8, 1, 0, 2},    // 13
    {0x0D, 5, 23, 1, 1, 4, Digits::None, 8, 2, 0, 0},    // 14
    {0x05, 7, 23, 1, 1, 2, Digits::None, 8, 4, 0, 0},    // 15
    {0x15, 6, 23, 2, 1, 2, Digits::None, 8, 2, 5, 0},    // 16
    {0x25, 6, 23, 1, 2, 2, Digits::None, 8, 2, 0, 0},    // 17
    {0x09, 4, 15, 1, 1, 3, Digits::None, 5, 5, 0, 0},    // 18
}};

constexpr size_t kNoMode = kUastcModes.size();

// The mode of blocks by their lowest seven bits; kNoMode where they are no code.
constexpr auto kUastcModeOf = [] {
  std::array<uint8_t, 128> modes{};
  for (size_t bits = 0; bits < modes.size(); ++bits) {
    modes[bits] = kNoMode;
    for (size_t mode = 0; mode < kUastcModes.size(); ++mode)
      if ((bits & ((1u << kUastcModes[mode].codeBits) - 1)) == kUastcModes[mode].code)
        modes[bits] = static_cast<uint8_t>(mode);
  }
  return modes;
}();

}  // namespace braid::ktx2
