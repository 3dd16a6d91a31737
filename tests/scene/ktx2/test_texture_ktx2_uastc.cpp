// SPDX-License-Identifier: Apache-2.0
// UASTC blocks of every mode, against pixels worked out from the tables that the format's description prints.
#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "renderer/scene/data/ktx2/uastc.h"
#include "renderer/scene/data/ktx2/uastc_partitions.h"
#include "renderer/scene/data/ktx2/uastc_values.h"
#include "tests/scene/ktx2/uastc_expected.h"

namespace braid::test_texture_ktx2_uastc {

using namespace braid::ktx2;
namespace {

// Where the fields of a mode stand, as the description's summary of the mode encoding has them.
struct Layout {
  int mode;
  uint32_t code;
  int codeBits;
  int fieldAt, fieldBits;  // pattern or component
  int digitsAt, base;      // 3 trits, 5 quints, 0 none
  int endpointsAt, endpointBits, endpoints;
  int weightsAt, weightBits, planes;
};

constexpr std::array<Layout, 18> kLayouts = {{
    {0, 0x01, 4, 0, 0, 19, 3, 29, 6, 6, 65, 4, 1},
    {1, 0x35, 6, 0, 0, 0, 0, 21, 8, 6, 69, 2, 1},
    {2, 0x1D, 5, 20, 5, 0, 0, 25, 4, 12, 73, 3, 1},
    {3, 0x03, 5, 20, 4, 24, 3, 53, 2, 18, 89, 2, 1},
    {4, 0x13, 5, 20, 5, 25, 5, 53, 3, 12, 89, 2, 1},
    {5, 0x0B, 5, 0, 0, 0, 0, 20, 8, 6, 68, 3, 1},
    {6, 0x1B, 5, 20, 2, 22, 5, 36, 5, 6, 66, 2, 2},
    {7, 0x07, 5, 20, 5, 25, 5, 53, 3, 12, 89, 2, 1},
    {9, 0x0F, 5, 28, 5, 0, 0, 33, 4, 16, 97, 2, 1},
    {10, 0x02, 3, 0, 0, 20, 3, 33, 4, 8, 65, 4, 1},
    {11, 0x00, 2, 19, 2, 21, 3, 34, 4, 8, 66, 2, 2},
    {12, 0x06, 3, 0, 0, 20, 3, 33, 6, 8, 81, 3, 1},
    {13, 0x1F, 5, 28, 2, 0, 0, 30, 8, 8, 94, 1, 2},
    {14, 0x0D, 5, 0, 0, 0, 0, 28, 8, 8, 92, 2, 1},
    {15, 0x05, 7, 0, 0, 0, 0, 30, 8, 4, 62, 4, 1},
    {16, 0x15, 6, 29, 5, 0, 0, 34, 8, 8, 98, 2, 1},
    {17, 0x25, 6, 0, 0, 0, 0, 29, 8, 4, 61, 2, 2},
    {18, 0x09, 4, 0, 0, 0, 0, 19, 5, 6, 49, 5, 1},
}};

class BlockWriter {
 public:
  void put(uint32_t value, int at, int bits) {
    for (int i = 0; i < bits; ++i)
      if (value >> i & 1) block[static_cast<size_t>(at + i) / 8] |= static_cast<uint8_t>(1u << ((at + i) % 8));
  }
  std::array<uint8_t, 16> block{};
};

// Digits in groups of five trits in 8 bits or three quints in 7; three trits that are left over take 5 bits, one 2.
void putDigits(BlockWriter& out, const Layout& layout) {
  const int group = layout.base == 3 ? 5 : 3, full = layout.base == 3 ? 8 : 7;
  int at = layout.digitsAt;
  for (int first = 0; first < layout.endpoints; first += group) {
    uint32_t packed = 0;
    const int count = std::min(group, layout.endpoints - first);
    for (int k = first + count; k-- > first;)
      packed =
          packed * static_cast<uint32_t>(layout.base) + static_cast<uint32_t>((k * 2 + 1 + layout.mode) % layout.base);
    const int bits = count == group ? full : count == 3 ? 5 : 2;
    out.put(packed, at, bits);
    at += bits;
  }
  CHECK(at == layout.endpointsAt);
}

// Endpoint k has the digit (2k + 1 + mode) mod base and the bits (37k + 11 + mode) mod 2^n, texel i the weights
// (3i + mode) mod 2^n and (5i + 1) mod 2^n. Anchors, `anchors` says which texels are, keep all but the highest bit.
std::array<uint8_t, 16> writeBlock(const Layout& layout, uint32_t field, uint32_t anchors) {
  BlockWriter out;
  out.put(layout.code, 0, layout.codeBits);
  out.put(field, layout.fieldAt, layout.fieldBits);
  if (layout.base > 0) putDigits(out, layout);
  for (int k = 0; k < layout.endpoints; ++k)
    out.put(static_cast<uint32_t>(k * 37 + 11 + layout.mode), layout.endpointsAt + k * layout.endpointBits,
            layout.endpointBits);
  CHECK(layout.endpointsAt + layout.endpoints * layout.endpointBits == layout.weightsAt);
  int at = layout.weightsAt;
  for (int i = 0; i < 16; ++i)
    for (int plane = 0; plane < layout.planes; ++plane) {
      const int bits = layout.weightBits - static_cast<int>(anchors >> i & 1);
      out.put(static_cast<uint32_t>(plane == 0 ? i * 3 + layout.mode : i * 5 + 1), at, bits);
      at += bits;
    }
  CHECK(at <= 128);
  return out.block;
}

std::string hex(const Block& block) {
  std::string text;
  for (const Texel& texel : block) {
    if (!text.empty()) text += ' ';
    for (const uint8_t channel : texel) {
      constexpr char kDigits[] = "0123456789ABCDEF";
      text += {kDigits[channel >> 4], kDigits[channel & 15]};
    }
  }
  return text;
}

// ASTC's own rule for the subset of a texel (Khronos Data Format 1.4, ASTC, "Partition Pattern Generation"), for 4x4
// blocks, whose coordinates count double.
uint32_t astcSubset(uint32_t index, uint32_t x, uint32_t y, uint32_t subsets) {
  const uint32_t seed = index + (subsets - 1) * 1024;
  uint32_t hash = seed;
  hash ^= hash >> 15;
  hash *= 0xEEDE0891;  // as the subtraction and the additions of shifted values do together
  hash ^= hash >> 5;
  hash *= 0x10001;
  hash ^= hash >> 7;
  hash ^= hash >> 3;
  hash ^= hash << 6;
  hash ^= hash >> 17;
  const uint32_t byBit = (seed & 2) ? 4 : 5, byCount = subsets == 3 ? 6 : 5;
  const std::array<uint32_t, 2> shifts = (seed & 1) ? std::array{byBit, byCount} : std::array{byCount, byBit};
  uint32_t best = 0, most = 0;
  for (uint32_t subset = 0; subset < subsets; ++subset) {
    const auto factor = [&](uint32_t axis) {
      const uint32_t part = hash >> (8 * subset + 4 * axis) & 15;
      return part * part >> shifts[axis];
    };
    const uint32_t value = (factor(0) * 2 * x + factor(1) * 2 * y + (hash >> (14 - 4 * subset))) & 63;
    if (subset == 0 || value > most) {
      best = subset;
      most = value;
    }
  }
  return best;
}

std::vector<int> valuesOf(Digits digits, int bits, uint32_t base) {
  std::vector<int> values;
  for (uint32_t digit = 0; digit < base; ++digit)
    for (uint32_t value = 0; value < 1u << bits; ++value) values.push_back(endpointValue(digit, value, digits, bits));
  return values;
}

}  // namespace

TEST_CASE("UASTC: every mode gives the pixels of its description, bit for bit") {
  int tried = 0;
  for (const Expected& expected : kExpected)
    for (const Layout& layout : kLayouts) {
      if (layout.mode != expected.mode) continue;
      const auto block = writeBlock(layout, expected.field, anchorsOf(layout.mode));
      CHECK_MESSAGE(hex(decodeUastcBlock(block.data(), expected.srgb)) == expected.pixels, "mode ", layout.mode);
      ++tried;
    }
  CHECK(tried == 36);
}

TEST_CASE("UASTC: a solid block, the hints of other formats behind it") {
  BlockWriter out;
  out.put(0x17, 0, 5);
  out.put(0x4030201, 5, 32);
  out.put(0x1FFFFF, 37, 21);
  const Block block = decodeUastcBlock(out.block.data(), true);
  for (const Texel& texel : block) CHECK(texel == Texel{1, 2, 3, 4});
}

TEST_CASE("UASTC: hints change no pixel") {
  for (const Layout& layout : kLayouts) {
    const auto plain = writeBlock(layout, 0, anchorsOf(layout.mode));
    BlockWriter hinted{plain};
    const int end = layout.fieldBits > 0 ? layout.fieldAt : layout.base > 0 ? layout.digitsAt : layout.endpointsAt;
    hinted.put(0x3FFFFFF, layout.codeBits, end - layout.codeBits);
    CHECK(decodeUastcBlock(plain.data(), false) == decodeUastcBlock(hinted.block.data(), false));
  }
}

TEST_CASE("UASTC: blocks that are none are magenta") {
  const auto isMagenta = [](const std::array<uint8_t, 16>& block) {
    for (const Texel& texel : decodeUastcBlock(block.data(), false))
      if (texel != Texel{255, 0, 255, 255}) return false;
    return true;
  };
  BlockWriter reserved;
  reserved.put(0x45, 0, 7);  // mode 19
  CHECK(isMagenta(reserved.block));
  const std::array<std::pair<int, uint32_t>, 6> patterns = {{{2, 30}, {3, 11}, {4, 30}, {7, 19}, {9, 30}, {16, 30}}};
  for (const auto& [mode, count] : patterns)
    for (const Layout& layout : kLayouts) {
      if (layout.mode != mode) continue;
      CHECK(isMagenta(writeBlock(layout, count, anchorsOf(mode))));
      CHECK_FALSE(isMagenta(writeBlock(layout, count - 1, anchorsOf(mode))));
    }
  // Every other beginning is a mode.
  int modes = 0;
  for (const uint8_t mode : kUastcModeOf) modes += mode != kNoMode;
  CHECK(modes == 127);
}

TEST_CASE("UASTC: digits above the largest number of a group wrap as the description says") {
  // Mode 0 with ET[0] = 255: trits 0 1 1 0 0 by remainders, as 12 has them.
  BlockWriter high, low;
  high.put(0x01, 0, 4);
  low.put(0x01, 0, 4);
  high.put(255, 19, 8);
  low.put(12, 19, 8);
  CHECK(decodeUastcBlock(high.block.data(), false) == decodeUastcBlock(low.block.data(), false));
}

TEST_CASE("UASTC: endpoints are the numbers of the printed tables") {
  CHECK(valuesOf(Digits::Trits, 2, 3) == std::vector<int>{0, 255, 69, 186, 23, 232, 92, 163, 46, 209, 116, 139});
  CHECK(valuesOf(Digits::Quints, 3, 5) ==
        std::vector<int>{0,  255, 32,  223, 65, 190, 97, 158, 6,  249, 39,  216, 71, 184, 104, 151, 13, 242, 45,  210,
                         78, 177, 110, 145, 19, 236, 52, 203, 84, 171, 117, 138, 26, 229, 58,  197, 91, 164, 123, 132});
  CHECK(valuesOf(Digits::Trits, 4, 3) == std::vector<int>{0,  255, 16,  239, 32,  223, 48,  207, 65,  190, 81,  174,
                                                          97, 158, 113, 142, 5,   250, 21,  234, 38,  217, 54,  201,
                                                          70, 185, 86,  169, 103, 152, 119, 136, 11,  244, 27,  228,
                                                          43, 212, 59,  196, 76,  179, 92,  163, 108, 147, 124, 131});
  // Of the two long tables their first and last rows.
  const std::vector<int> quints = valuesOf(Digits::Quints, 5, 5), trits = valuesOf(Digits::Trits, 6, 3);
  REQUIRE(quints.size() == 160);
  REQUIRE(trits.size() == 192);
  CHECK(std::vector<int>(quints.begin(), quints.begin() + 16) ==
        std::vector<int>{0, 255, 8, 247, 16, 239, 24, 231, 32, 223, 40, 215, 48, 207, 56, 199});
  CHECK(std::vector<int>(quints.end() - 16, quints.end()) ==
        std::vector<int>{70, 185, 78, 177, 86, 169, 94, 161, 102, 153, 110, 145, 118, 137, 126, 129});
  CHECK(std::vector<int>(trits.begin(), trits.begin() + 16) ==
        std::vector<int>{0, 255, 4, 251, 8, 247, 12, 243, 16, 239, 20, 235, 24, 231, 28, 227});
  CHECK(std::vector<int>(trits.end() - 16, trits.end()) ==
        std::vector<int>{98, 157, 102, 153, 106, 149, 110, 145, 114, 141, 118, 137, 122, 133, 126, 129});
}

TEST_CASE("UASTC: weights are the numbers of the printed table") {
  const auto weights = [](int bits) {
    std::vector<int> values;
    for (uint32_t value = 0; value < 1u << bits; ++value) values.push_back(weightValue(value, bits));
    return values;
  };
  CHECK(weights(1) == std::vector<int>{0, 64});
  CHECK(weights(2) == std::vector<int>{0, 21, 43, 64});
  CHECK(weights(3) == std::vector<int>{0, 9, 18, 27, 37, 46, 55, 64});
  CHECK(weights(4) == std::vector<int>{0, 4, 8, 12, 17, 21, 25, 29, 35, 39, 43, 47, 52, 56, 60, 64});
  for (int i = 0; i < 32; ++i) CHECK(weights(5)[static_cast<size_t>(i)] == 2 * i + (i >= 16 ? 2 : 0));
}

TEST_CASE("UASTC: every pattern begins its subsets at the anchors of the printed tables") {
  const auto anchors = [](std::span<const Partition> partitions, uint8_t subset) {
    std::vector<int> first;
    for (const Partition& p : partitions)
      first.push_back(static_cast<int>(std::find(p.subset.begin(), p.subset.end(), subset) - p.subset.begin()));
    return first;
  };
  const auto two = uastcPartitions(2, 2), seven = uastcPartitions(7, 2), three = uastcPartitions(3, 3);
  CHECK(anchors(two, 0) ==
        std::vector<int>{0, 0, 1, 0, 7, 0, 3, 7, 0, 2, 0, 11, 3, 8, 0, 12, 1, 8, 0, 0, 0, 8, 1, 0, 4, 0, 4, 1, 4, 1});
  CHECK(anchors(two, 1) ==
        std::vector<int>{2, 3, 0, 3, 0, 2, 0, 0, 11, 0, 7, 0, 0, 0, 4, 0, 0, 0, 1, 2, 4, 0, 0, 2, 0, 1, 0, 0, 0, 0});
  CHECK(anchors(seven, 0) == std::vector<int>{0, 0, 2, 0, 8, 0, 0, 0, 2, 0, 0, 2, 0, 0, 12, 2, 9, 0, 4});
  CHECK(anchors(seven, 1) == std::vector<int>{4, 2, 0, 7, 0, 1, 3, 1, 0, 1, 8, 0, 1, 7, 0, 0, 0, 2, 0});
  CHECK(anchors(three, 0) == std::vector<int>{0, 8, 4, 8, 3, 0, 0, 1, 1, 4, 0});
  CHECK(anchors(three, 1) == std::vector<int>{8, 0, 0, 0, 0, 1, 2, 9, 2, 0, 6});
  CHECK(anchors(three, 2) == std::vector<int>{10, 12, 12, 4, 2, 3, 1, 0, 0, 8, 2});
  for (const auto partitions : {two, seven, three})
    for (const Partition& p : partitions) {
      uint32_t seen = 0;
      for (size_t i = 0; i < 16; ++i) {
        CHECK(((p.anchors >> i & 1) != 0) == !(seen >> p.subset[i] & 1));
        seen |= 1u << p.subset[i];
      }
    }
}

TEST_CASE("UASTC: every texel of every pattern is in the subset that ASTC's rule gives it") {
  const std::vector<uint32_t> two = {28, 20,  16,  29, 91,  9,   107, 72,  149, 204, 50,  114, 496, 17,  78,
                                     39, 252, 828, 43, 156, 116, 210, 476, 273, 684, 359, 246, 195, 694, 524};
  const std::vector<uint32_t> seven = {36,  48,  61,  137, 161, 183, 226, 281, 302, 307,
                                       479, 495, 593, 594, 605, 799, 812, 988, 993};
  const std::vector<uint32_t> three = {260, 74, 32, 156, 183, 15, 745, 0, 335, 902, 254};
  const auto check = [](std::span<const Partition> partitions, const std::vector<uint32_t>& seeds, uint32_t subsets) {
    REQUIRE(partitions.size() == seeds.size());
    for (size_t p = 0; p < seeds.size(); ++p)
      for (uint32_t i = 0; i < 16; ++i) {
        INFO("pattern ", p, ", texel ", i);
        CHECK(partitions[p].subset[i] == astcSubset(seeds[p], i % 4, i / 4, subsets));
      }
  };
  check(uastcPartitions(2, 2), two, 2);
  check(uastcPartitions(7, 2), seven, 2);
  check(uastcPartitions(3, 3), three, 3);
}

TEST_CASE("UASTC: a picture whose sides are no multiples of four is cut") {
  std::vector<uint8_t> level;
  for (uint32_t i = 0; i < 4; ++i) {
    BlockWriter out;
    out.put(0x17, 0, 5);
    out.put(0xFF000000 | i, 5, 32);
    level.insert(level.end(), out.block.begin(), out.block.end());
  }
  const ByteTexels picture = decodeUastc(level, 5, 7, false);
  REQUIRE(picture.rgba.size() == 35 * 4);
  for (size_t y = 0; y < 7; ++y)
    for (size_t x = 0; x < 5; ++x) CHECK(picture.rgba[(y * 5 + x) * 4] == x / 4 + 2 * (y / 4));
  level.pop_back();
  CHECK_THROWS_AS(decodeUastc(level, 5, 7, false), Error);
}

TEST_CASE("UASTC: any number of threads gives the same pixels") {
  std::mt19937 random(3);
  std::vector<uint8_t> level(33 * 21 * kUastcBlockBytes);
  for (uint8_t& byte : level) byte = static_cast<uint8_t>(random());
  const auto decoded = [&](int threads) {
    std::vector<uint8_t> pixels;
    withThreads(threads, [&] { pixels = decodeUastc(level, 131, 83, true).rgba; });
    return pixels;
  };
  CHECK(decoded(1) == decoded(2));
}

}  // namespace braid::test_texture_ktx2_uastc
