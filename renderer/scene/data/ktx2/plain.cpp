// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/ktx2/plain.h"

#include <array>
#include <bit>

#include "renderer/core/parallel.h"

namespace braid::ktx2 {

namespace {

// The Vulkan formats with 1, 2, 3 and 4 channels of each kind; 0: there is none.
struct Family {
  std::array<uint32_t, 4> formats;
  PlainFormat format;
};
constexpr std::array<Family, 8> kFamilies = {{{{9, 16, 23, 37}, {0, Sample::Byte, false, false}},
                                              {{15, 22, 29, 43}, {0, Sample::Byte, true, false}},
                                              {{0, 0, 30, 44}, {0, Sample::Byte, false, true}},
                                              {{0, 0, 36, 50}, {0, Sample::Byte, true, true}},
                                              {{70, 77, 84, 91}, {0, Sample::Short, false, false}},
                                              {{76, 83, 90, 97}, {0, Sample::Half, false, false}},
                                              {{100, 103, 106, 109}, {0, Sample::Float, false, false}}}};

float halfToFloat(uint32_t half) {
  const uint32_t sign = (half & 0x8000) << 16, exponent = half >> 10 & 31, mantissa = half & 0x3FF;
  if (exponent == 0) {
    const float tiny = static_cast<float>(mantissa) * 0x1p-24f;
    return sign ? -tiny : tiny;
  }
  return std::bit_cast<float>(sign | (exponent == 31 ? 255u : exponent + 112) << 23 | mantissa << 13);
}

float sampleAt(const PlainFormat& format, const uint8_t* at) {
  const uint32_t low = at[0] | at[1] << 8;
  if (format.sample == Sample::Short) return static_cast<float>(low) / 65535.0f;
  if (format.sample == Sample::Half) return halfToFloat(low);
  return std::bit_cast<float>(low | uint32_t(at[2]) << 16 | uint32_t(at[3]) << 24);
}

// RGBA of `count` texels.
template <size_t channels, class T, class Read>
void unpack(const PlainFormat& format, const uint8_t* texel, size_t count, T one, T* rgba, const Read& read) {
  const size_t bytes = format.sampleBytes(), red = format.isBgr ? 2 : 0, blue = 2 - red;
  for (size_t i = 0; i < count; ++i, texel += channels * bytes, rgba += 4) {
    rgba[0] = channels < 3 ? read(texel) : read(texel + red * bytes);
    rgba[1] = channels < 2 ? T(0) : read(texel + bytes);
    rgba[2] = channels < 3 ? T(0) : read(texel + blue * bytes);
    rgba[3] = channels < 4 ? one : read(texel + 3 * bytes);
  }
}

template <class T, class Read>
std::vector<T> unpacked(const PlainFormat& format, Bytes data, size_t texels, T one, const Read& read) {
  const Bytes source = part(data, 0, texels * format.texelBytes(), "a level");
  std::vector<T> out(texels * 4);
  constexpr std::array kUnpack = {unpack<1, T, Read>, unpack<2, T, Read>, unpack<3, T, Read>, unpack<4, T, Read>};
  const auto run = kUnpack[format.channels - 1u];
  parallelChunks(texels, kPixelChunk, [&](size_t begin, size_t end) {
    run(format, source.data() + begin * format.texelBytes(), end - begin, one, out.data() + begin * 4, read);
  });
  return out;
}

}  // namespace

std::optional<PlainFormat> plainFormat(uint32_t vkFormat) {
  for (const Family& family : kFamilies) {
    for (size_t i = 0; i < family.formats.size(); ++i) {
      if (vkFormat == 0 || family.formats[i] != vkFormat) continue;
      PlainFormat format = family.format;
      format.channels = static_cast<uint8_t>(i + 1);
      return format;
    }
  }
  return std::nullopt;
}

std::vector<uint8_t> plainBytes(const PlainFormat& format, Bytes data, size_t texels) {
  return unpacked<uint8_t>(format, data, texels, 255, [](const uint8_t* at) { return *at; });
}

std::vector<float> plainFloats(const PlainFormat& format, Bytes data, size_t texels) {
  return unpacked<float>(format, data, texels, 1.0f, [&](const uint8_t* at) { return sampleAt(format, at); });
}

}  // namespace braid::ktx2
