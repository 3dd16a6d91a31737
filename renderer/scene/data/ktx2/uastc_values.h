// SPDX-License-Identifier: Apache-2.0
// From the stored endpoints and weights of UASTC to the numbers that they stand for (Khronos Data Format 1.4, ASTC,
// "Endpoint Unquantization" and "Weight Unquantization").
#pragma once

#include "renderer/scene/data/ktx2/uastc_modes.h"

namespace braid::ktx2 {

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
