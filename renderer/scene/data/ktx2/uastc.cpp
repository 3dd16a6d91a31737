// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/ktx2/uastc.h"

#include "renderer/scene/data/ktx2/uastc_partitions.h"
#include "renderer/scene/data/ktx2/uastc_values.h"

namespace braid::ktx2 {

namespace {

constexpr size_t kMostSubsets = 3, kMostEndpoints = 18;

// The 128 bits of a block, from the lowest.
class BlockBits {
 public:
  explicit BlockBits(const uint8_t* block) {
    for (size_t i = 8; i-- > 0;) {
      low_ = low_ << 8 | block[i];
      high_ = high_ << 8 | block[i + 8];
    }
  }

  uint32_t peek(int bits) const { return static_cast<uint32_t>(low_ & ((uint64_t(1) << bits) - 1)); }

  // At most 32 bits.
  uint32_t take(int bits) {
    const uint32_t value = peek(bits);
    if (bits > 0) {
      low_ = low_ >> bits | high_ << (64 - bits);
      high_ >>= bits;
    }
    return value;
  }

 private:
  uint64_t low_ = 0, high_ = 0;
};

// Both ends of a subset's colours, 16 bits a channel.
struct Ends {
  std::array<uint32_t, 4> low, high;
};

void takeDigits(BlockBits& in, Digits digits, size_t count, std::array<uint32_t, kMostEndpoints>& out) {
  const bool isTrit = digits == Digits::Trits;
  const uint32_t base = isTrit ? 3 : 5;
  const size_t group = isTrit ? 5 : 3;
  constexpr std::array<int, 6> kTritBits = {0, 2, 4, 5, 7, 8}, kQuintBits = {0, 3, 5, 7, 0, 0};
  for (size_t first = 0; first < count; first += group) {
    const size_t held = std::min(group, count - first);
    uint32_t packed = in.take(isTrit ? kTritBits[held] : kQuintBits[held]);
    for (size_t i = 0; i < held; ++i, packed /= base) out[first + i] = packed % base;
  }
}

std::array<Ends, kMostSubsets> takeEnds(BlockBits& in, const UastcMode& mode, bool srgb) {
  std::array<uint32_t, kMostEndpoints> values{};
  const size_t count = size_t(2) * mode.subsets * mode.colours;
  if (mode.digits != Digits::None) takeDigits(in, mode.digits, count, values);
  for (size_t i = 0; i < count; ++i) {
    const uint32_t value = endpointValue(values[i], in.take(mode.endpointBits), mode.digits, mode.endpointBits);
    values[i] = value << 8 | (srgb ? 0x80 : value);
  }
  std::array<Ends, kMostSubsets> ends;
  const uint32_t opaque = 0xFF00 | (srgb ? 0x80 : 0xFF);
  for (size_t subset = 0; subset < mode.subsets; ++subset) {
    const uint32_t* value = &values[subset * mode.colours * 2];
    for (size_t channel = 0; channel < 4; ++channel) {
      // Of luminance and alpha, the first is all colours.
      const size_t stored = mode.colours == 2 ? channel / 3 : channel;
      const bool isStored = stored < mode.colours;
      ends[subset].low[channel] = isStored ? value[stored * 2] : opaque;
      ends[subset].high[channel] = isStored ? value[stored * 2 + 1] : opaque;
    }
  }
  return ends;
}

uint8_t mixed(uint32_t low, uint32_t high, uint32_t weight) {
  return static_cast<uint8_t>((low * (64 - weight) + high * weight + 32) >> 14);
}

constexpr auto kWeights = [] {
  std::array<std::array<uint8_t, 32>, 6> weights{};
  for (int bits = 1; bits <= 5; ++bits)
    for (uint32_t value = 0; value < 1u << bits; ++value)
      weights[static_cast<size_t>(bits)][value] = weightValue(value, bits);
  return weights;
}();

Block filled(const Texel& texel) {
  Block block;
  block.fill(texel);
  return block;
}

Block decodeInterpolated(BlockBits& in, const UastcMode& mode, size_t modeIndex, bool srgb, const Block& invalid) {
  in.take(mode.hintBits);
  const uint32_t pattern = in.take(mode.patternBits);
  // Without the field, the second plane is for alpha.
  const size_t component = mode.componentBits > 0 ? in.take(mode.componentBits) : 3;
  const std::span<const Partition> partitions = uastcPartitions(modeIndex, mode.subsets);
  if (pattern >= partitions.size()) return invalid;
  const Partition& partition = partitions[pattern];
  const std::array<Ends, kMostSubsets> ends = takeEnds(in, mode, srgb);
  const auto& weights = kWeights[mode.weightBits];
  Block block;
  for (size_t texel = 0; texel < block.size(); ++texel) {
    const int bits = mode.weightBits - (partition.anchors >> texel & 1);
    const uint32_t weight = weights[in.take(bits)];
    const Ends& colours = ends[partition.subset[texel]];
    for (size_t c = 0; c < 4; ++c) block[texel][c] = mixed(colours.low[c], colours.high[c], weight);
    if (mode.planes == 2)
      block[texel][component] = mixed(colours.low[component], colours.high[component], weights[in.take(bits)]);
  }
  return block;
}

}  // namespace

Block decodeUastcBlock(const uint8_t* data, bool srgb) {
  static const Block kInvalid = filled({255, 0, 255, 255});
  BlockBits in(data);
  const size_t index = kUastcModeOf[in.peek(7)];
  if (index == kNoMode) return kInvalid;
  const UastcMode& mode = kUastcModes[index];
  in.take(mode.codeBits);
  if (index != kSolidMode) return decodeInterpolated(in, mode, index, srgb, kInvalid);
  Texel texel;
  for (uint8_t& channel : texel) channel = static_cast<uint8_t>(in.take(8));
  return filled(texel);
}

ByteTexels decodeUastc(Bytes level, size_t width, size_t height, bool srgb) {
  const Bytes blocks = part(level, 0, blocksAlong(width) * blocksAlong(height) * kUastcBlockBytes, "a level");
  ByteTexels picture(width, height);
  fillWithBlocks(picture, [&](size_t index) { return decodeUastcBlock(&blocks[index * kUastcBlockBytes], srgb); });
  return picture;
}

}  // namespace braid::ktx2
