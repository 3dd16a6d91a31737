// SPDX-License-Identifier: Apache-2.0
// Writes KTX2 files for tests, from their parts.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace braid::test {

using ByteVector = std::vector<uint8_t>;

// A stream of bits, the least significant bit of every byte first.
class BitWriter {
 public:
  // The lowest bits of the value; beyond its 64 there are zeros.
  void put(uint64_t value, int bits) {
    for (int i = 0; i < bits; ++i, ++count_) {
      if (count_ % 8 == 0) bytes_.push_back(0);
      if (i < 64 && (value >> i & 1)) bytes_.back() = static_cast<uint8_t>(bytes_.back() | 1u << (count_ % 8));
    }
  }
  const ByteVector& bytes() const { return bytes_; }

 private:
  ByteVector bytes_;
  size_t count_ = 0;
};

inline void append(ByteVector& out, const ByteVector& bytes) { out.insert(out.end(), bytes.begin(), bytes.end()); }

inline void appendNumber(ByteVector& out, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

// What a KTX2 file is made of. Levels stand in the file from the smallest to the largest, level 0.
struct Ktx2Writer {
  uint32_t vkFormat = 0, typeSize = 1, width = 4, height = 4, depth = 0, layers = 0, faces = 1, scheme = 0;
  uint8_t model = 1, transfer = 1, flags = 0;
  std::vector<uint8_t> channels = {0};
  std::map<std::string, std::string> keys;
  ByteVector globalData;
  std::vector<ByteVector> levels = {{}};

  ByteVector descriptor() const {
    ByteVector out;
    const auto bytes = static_cast<uint32_t>(24 + 16 * channels.size());
    appendNumber(out, bytes + 4, 4);
    appendNumber(out, 0, 4);                          // vendor and type: Khronos, basic
    appendNumber(out, 2 | uint64_t(bytes) << 16, 4);  // version and size
    append(out, {model, 1, transfer, flags, 3, 3, 0, 0, 16, 0, 0, 0, 0, 0, 0, 0});
    for (const uint8_t channel : channels) {
      appendNumber(out, 0x003F0000 | uint64_t(channel) << 24, 8);
      appendNumber(out, uint64_t(0xFFFFFFFF) << 32, 8);
    }
    return out;
  }

  ByteVector keyValues() const {
    ByteVector out;
    for (const auto& [key, value] : keys) {
      appendNumber(out, key.size() + 1 + value.size(), 4);
      append(out, {key.begin(), key.end()});
      out.push_back(0);
      append(out, {value.begin(), value.end()});
      while (out.size() % 4 != 0) out.push_back(0);
    }
    return out;
  }

  ByteVector file() const {
    ByteVector out = {0xAB, 'K', 'T', 'X', ' ', '2', '0', 0xBB, '\r', '\n', 0x1A, '\n'};
    for (const uint32_t field :
         {vkFormat, typeSize, width, height, depth, layers, faces, static_cast<uint32_t>(levels.size()), scheme})
      appendNumber(out, field, 4);
    const ByteVector description = descriptor(), pairs = keyValues();
    uint64_t at = 80 + 24 * levels.size();
    appendNumber(out, at, 4);
    appendNumber(out, description.size(), 4);
    at += description.size();
    appendNumber(out, pairs.empty() ? 0 : at, 4);
    appendNumber(out, pairs.size(), 4);
    at = (at + pairs.size() + 7) / 8 * 8;
    const uint64_t global = at;
    appendNumber(out, globalData.empty() ? 0 : global, 8);
    appendNumber(out, globalData.size(), 8);
    at += globalData.size();
    std::vector<uint64_t> offsets(levels.size());
    for (size_t level = levels.size(); level-- > 0; at += levels[level].size()) {
      at = (at + 15) / 16 * 16;
      offsets[level] = at;
    }
    for (size_t level = 0; level < levels.size(); ++level) {
      appendNumber(out, offsets[level], 8);
      appendNumber(out, levels[level].size(), 8);
      appendNumber(out, scheme == 1 ? 0 : levels[level].size(), 8);  // unpacked, if the scheme says so
    }
    append(out, description);
    append(out, pairs);
    out.resize(global);
    append(out, globalData);
    for (size_t level = levels.size(); level-- > 0;) {
      out.resize(offsets[level]);
      append(out, levels[level]);
    }
    return out;
  }
};

}  // namespace braid::test
