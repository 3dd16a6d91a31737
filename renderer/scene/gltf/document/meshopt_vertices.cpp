// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/document/meshopt_vertices.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

namespace braid::gltf {

namespace {

constexpr size_t kGroup = 16, kMostElements = 256, kMostStride = 256, kLeastTail = 24;
using Deltas = std::array<uint8_t, kMostElements>;  // of one byte of all elements of a block

template <class T>
T unzigzag(T v) {
  return static_cast<T>((v & 1) != 0 ? ~(v >> 1) : v >> 1);
}

// Bytes up to where the tail begins.
class Source {
 public:
  explicit Source(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  bool take(size_t count, std::span<const uint8_t>& out) {
    if (count > bytes_.size() - at_) return false;
    out = bytes_.subspan(at_, count);
    at_ += count;
    return true;
  }
  bool empty() const { return at_ == bytes_.size(); }

 private:
  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
};

// 16 deltas of `bits` each; those with all bits set follow as bytes.
bool readGroup(Source& source, int bits, uint8_t* out) {
  std::span<const uint8_t> packed, escaped;
  if (!source.take(kGroup * static_cast<size_t>(bits) / 8, packed)) return false;
  const int perByte = 8 / std::max(bits, 1);
  const auto sentinel = static_cast<uint8_t>((1 << bits) - 1);
  for (size_t i = 0; i < kGroup; ++i) {
    if (bits == 0 || bits == 8) {
      out[i] = bits == 0 ? uint8_t{0} : packed[i];
      continue;
    }
    const int place = static_cast<int>(i) % perByte;
    const int shift = bits == 1 ? place : (perByte - 1 - place) * bits;  // single bits from the lowest on
    out[i] = static_cast<uint8_t>(packed[i / static_cast<size_t>(perByte)] >> shift & sentinel);
    if (out[i] != sentinel) continue;
    if (!source.take(1, escaped)) return false;
    out[i] = escaped[0];
  }
  return true;
}

bool readDeltas(Source& source, int control, size_t elements, Deltas& deltas) {
  constexpr int kBits[2][4] = {{0, 1, 2, 4}, {1, 2, 4, 8}};
  std::span<const uint8_t> bytes;
  if (control == 2) {
    deltas.fill(0);
    return true;
  }
  if (control == 3) {
    if (!source.take(elements, bytes)) return false;
    std::copy(bytes.begin(), bytes.end(), deltas.begin());
    return true;
  }
  const size_t groups = (elements + kGroup - 1) / kGroup;
  if (!source.take((groups + 3) / 4, bytes)) return false;
  for (size_t g = 0; g < groups; ++g)
    if (!readGroup(source, kBits[control][bytes[g / 4] >> (2 * (g % 4)) & 3], &deltas[g * kGroup])) return false;
  return true;
}

uint32_t load(const uint8_t* bytes) {
  return bytes[0] | uint32_t{bytes[1]} << 8 | uint32_t{bytes[2]} << 16 | uint32_t{bytes[3]} << 24;
}

void store(uint32_t value, uint8_t* bytes) {
  for (int k = 0; k < 4; ++k) bytes[k] = static_cast<uint8_t>(value >> (8 * k));
}

// Four bytes of an element after those of the one before.
uint32_t next(uint32_t before, uint32_t delta, uint8_t mode) {
  if ((mode & 15) == 2) return before ^ std::rotr(delta, mode >> 4);
  uint32_t result = 0;
  const int width = (mode & 15) == 1 ? 16 : 8;
  for (int shift = 0; shift < 32; shift += width) {
    const uint32_t part = delta >> shift, old = before >> shift;
    const uint32_t sum = width == 16 ? uint16_t(old + unzigzag(static_cast<uint16_t>(part)))
                                     : uint8_t(old + unzigzag(static_cast<uint8_t>(part)));
    result |= sum << shift;
  }
  return result;
}

template <class Unsigned>
void decodeColours(uint8_t* data, size_t count) {
  using Signed = std::make_signed_t<Unsigned>;
  constexpr float kMost = std::numeric_limits<Unsigned>::max();
  for (size_t i = 0; i < count; ++i) {
    Unsigned c[4];
    std::memcpy(c, data + i * sizeof(c), sizeof(c));
    const int y = c[0], co = static_cast<Signed>(c[1]), cg = static_cast<Signed>(c[2]);
    // The highest bit of alpha says how many bits there are.
    const int most = (1 << std::bit_width(static_cast<unsigned>(c[3]))) - 1;
    const int half = c[3] & (most >> 1), alpha = half << 1 | (half & 1);
    const float scale = kMost / static_cast<float>(std::max(most, 1));
    const int rgba[4] = {y + co - cg, y + cg, y - co - cg, alpha};
    for (int k = 0; k < 4; ++k)
      c[k] = static_cast<Unsigned>(std::clamp(std::round(static_cast<float>(rgba[k]) * scale), 0.0f, kMost));
    std::memcpy(data + i * sizeof(c), c, sizeof(c));
  }
}

}  // namespace

bool decodeMeshoptVertices(std::span<const uint8_t> stream, size_t count, size_t stride, uint8_t* out) {
  const size_t channels = stride / 4, tail = std::max(stride + channels, kLeastTail);
  if (stride == 0 || stride % 4 != 0 || stride > kMostStride || stream.size() < 1 + tail ||
      stream[0] != kMeshoptVersion1)
    return false;
  const std::span<const uint8_t> last = stream.last(stride + channels), modes = last.last(channels);
  for (const uint8_t mode : modes)
    if ((mode & 15) > 2 || ((mode & 15) < 2 && mode > 15)) return false;
  std::array<uint8_t, kMostStride> before;
  std::copy_n(last.begin(), stride, before.begin());
  Source source(stream.subspan(1, stream.size() - 1 - tail));
  const size_t most = std::min((8192 / stride) & ~size_t{15}, kMostElements);
  std::array<Deltas, 4> deltas;
  for (size_t first = 0; first < count; first += most) {
    const size_t elements = std::min(count - first, most);
    std::span<const uint8_t> control;
    if (!source.take(channels, control)) return false;
    for (size_t c = 0; c < channels; ++c) {
      for (size_t k = 0; k < 4; ++k)
        if (!readDeltas(source, control[c] >> (2 * k) & 3, elements, deltas[k])) return false;
      uint32_t value = load(&before[4 * c]);
      for (size_t e = 0; e < elements; ++e) {
        const uint8_t bytes[4] = {deltas[0][e], deltas[1][e], deltas[2][e], deltas[3][e]};
        value = next(value, load(bytes), modes[c]);
        store(value, out + (first + e) * stride + 4 * c);
      }
      store(value, &before[4 * c]);
    }
  }
  return source.empty();
}

void decodeMeshoptColours(uint8_t* data, size_t count, size_t stride) {
  stride == 4 ? decodeColours<uint8_t>(data, count) : decodeColours<uint16_t>(data, count);
}

}  // namespace braid::gltf
