// SPDX-License-Identifier: Apache-2.0
// Texels that no block format packs: integers of 8 and 16 bits, floats of 16 and 32.
#pragma once

#include <optional>
#include <vector>

#include "renderer/scene/data/ktx2/bytes.h"

namespace braid::ktx2 {

enum class Sample : uint8_t { Byte, Short, Half, Float };

struct PlainFormat {
  uint8_t channels;
  Sample sample;
  bool srgb;
  bool isBgr;  // blue stands first

  size_t sampleBytes() const { return sample == Sample::Byte ? 1 : sample == Sample::Float ? 4 : 2; }
  size_t texelBytes() const { return channels * sampleBytes(); }
};

// Of a Vulkan format, if it is one of these.
std::optional<PlainFormat> plainFormat(uint32_t vkFormat);

// RGBA for every texel of `data`, which must hold so many: what is missing is 0, alpha 1. Bytes stay as they are.
std::vector<uint8_t> plainBytes(const PlainFormat& format, Bytes data, size_t texels);
// The same, integers of 16 bits scaled to [0,1].
std::vector<float> plainFloats(const PlainFormat& format, Bytes data, size_t texels);

}  // namespace braid::ktx2
