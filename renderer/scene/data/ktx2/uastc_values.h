// SPDX-License-Identifier: Apache-2.0
// UASTC's modes: how the bits of a block are divided (Khronos Data Format 1.4, "Universal ASTC"). And from the stored
// endpoints and weights of UASTC to the numbers that they stand for (Khronos Data Format 1.4, ASTC, "Endpoint
// Unquantization" and "Weight Unquantization").
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

namespace uastc_values {

// The nine-bit number B of the format: bits b, c, d, ... of `value` where its pattern has them.
constexpr uint32_t scattered(uint32_t value, Digits digits, int bits) {
  const auto bit = [&](int i) { return value >> i & 1; };
  if (digits == Digits::Trits && bits == 2)  // b000b0bb0
    return bit(1) << 8 | bit(1) << 4 | bit(1) << 2 | bit(1) << 1;
  const uint32_t upper = (value & ((1u << bits) - 1)) >> 1;
  if (digits == Digits::Trits && bits == 4) return upper << 6 | upper;       // dcb000dcb
  if (digits == Digits::Trits && bits == 6) return upper << 4 | upper >> 4;  // fedcb000f
  if (digits == Digits::Quints && bits == 3)                                 // cb0000cbc
    return upper << 7 | upper << 1 | upper >> 1;
  return upper << 5 | upper >> 3;  // quints, 5 bits: edcb0000e
}

constexpr uint32_t digitStep(Digits digits, int bits) {
  if (digits == Digits::Trits) return bits == 2 ? 93 : bits == 4 ? 22 : 5;
  return bits == 3 ? 26 : 6;
}

}  // namespace uastc_values

// The 8-bit endpoint of `bits` bits under a digit.
constexpr uint8_t endpointValue(uint32_t digit, uint32_t value, Digits digits, int bits) {
  if (digits == Digits::None) {
    uint32_t repeated = value << (8 - bits);
    for (int filled = bits; filled < 8; filled *= 2) repeated |= repeated >> filled;
    return static_cast<uint8_t>(repeated);
  }
  const uint32_t flip = (value & 1) ? 0x1FF : 0;
  const uint32_t sum =
      (digit * uastc_values::digitStep(digits, bits) + uastc_values::scattered(value, digits, bits)) ^ flip;
  return static_cast<uint8_t>((flip & 0x80) | sum >> 2);
}

// The weight, 0 to 64, of so many bits.
constexpr uint8_t weightValue(uint32_t value, int bits) {
  uint32_t repeated = value << (6 - bits);
  for (int filled = bits; filled < 6; filled *= 2) repeated |= repeated >> filled;
  return static_cast<uint8_t>(repeated > 32 ? repeated + 1 : repeated);
}

}  // namespace braid::ktx2
