// SPDX-License-Identifier: Apache-2.0
// Which texels of a UASTC block belong to which subset (Khronos Data Format 1.4, "Universal ASTC", Two subsets, Three
// subsets).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace braid::ktx2 {

struct Partition {
  std::array<uint8_t, 16> subset{};  // of every texel
  // The first texel of every subset: the highest bit of its weight is 0 and not stored.
  uint16_t anchors = 1;  // one bit a texel
};

namespace partition_tables {

constexpr std::array<uint16_t, 30> kTwo = {0xCCCC, 0x8888, 0x1111, 0xECC8, 0x377F, 0xFEEC, 0x0137, 0x137F,
                                           0xC800, 0x0013, 0xFE80, 0x17FF, 0x0017, 0x00FF, 0xFFF0, 0x0FFF,
                                           0xFF71, 0x8EFF, 0x08CE, 0x008C, 0x7310, 0xCEFF, 0x7331, 0x088C,
                                           0xCEEF, 0x6666, 0xF00F, 0x5555, 0x0F0F, 0x36C9};
constexpr std::array<uint16_t, 19> kTwoOfMode7 = {0x00F0, 0x4444, 0x0133, 0xCC80, 0xF0FF, 0x2222, 0xFFC8,
                                                  0xCCCE, 0x3C03, 0x00EE, 0x7700, 0x3003, 0x00CE, 0xFF80,
                                                  0x6FFF, 0x1333, 0x11FF, 0x136C, 0x00EF};
constexpr std::array<uint32_t, 11> kThree = {0xA5A50000, 0xAA005555, 0xAA000055, 0x0000AA55, 0x25252525, 0x94949494,
                                             0x58585858, 0x56560202, 0x92929292, 0x55AA0055, 0xA05050A0};

// From texel 0 in the lowest bits.
template <class Bits, size_t count>
constexpr std::array<Partition, count> unpacked(const std::array<Bits, count>& packed) {
  constexpr size_t kWidth = sizeof(Bits) * 8 / 16;
  std::array<Partition, count> partitions{};
  for (size_t p = 0; p < count; ++p) {
    partitions[p].anchors = 0;
    uint32_t seen = 0;
    for (size_t texel = 0; texel < 16; ++texel) {
      const uint32_t subset = packed[p] >> (texel * kWidth) & ((1u << kWidth) - 1);
      partitions[p].subset[texel] = static_cast<uint8_t>(subset);
      if (!(seen >> subset & 1)) partitions[p].anchors = static_cast<uint16_t>(partitions[p].anchors | 1u << texel);
      seen |= 1u << subset;
    }
  }
  return partitions;
}

inline constexpr std::array<Partition, 1> kOneSubset = {};
inline constexpr auto kTwoSubsets = unpacked(kTwo);
inline constexpr auto kTwoSubsetsOfMode7 = unpacked(kTwoOfMode7);
inline constexpr auto kThreeSubsets = unpacked(kThree);

}  // namespace partition_tables

// The patterns that blocks of a mode choose from; more than these no block may name.
constexpr std::span<const Partition> uastcPartitions(size_t mode, size_t subsets) {
  if (subsets == 1) return partition_tables::kOneSubset;
  if (subsets == 3) return partition_tables::kThreeSubsets;
  if (mode == 7) return partition_tables::kTwoSubsetsOfMode7;
  return partition_tables::kTwoSubsets;
}

}  // namespace braid::ktx2
