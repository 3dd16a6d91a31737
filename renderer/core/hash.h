// SPDX-License-Identifier: Apache-2.0
// Hashes: mixing functions for random numbers and a content hash for files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

namespace braid {

// 64-bit finaliser of SplitMix64 (Steele et al. 2014): a bijection with full avalanche.
constexpr uint64_t mix64(uint64_t x) {
  x ^= x >> 30;
  x *= 0xbf58476d1ce4e5b9ull;
  x ^= x >> 27;
  x *= 0x94d049bb133111ebull;
  x ^= x >> 31;
  return x;
}

constexpr uint64_t hashCombine(uint64_t h, uint64_t v) { return mix64(h + 0x9e3779b97f4a7c15ull + mix64(v)); }

// 32-bit mix with low bias ("lowbias32", Wellons 2018): three multiplies, vectorises.
constexpr uint32_t mix32(uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return x;
}

// Streaming content hash (not cryptographic): 8 bytes a step.
class ContentHash {
 public:
  void add(const void* data, size_t bytes) {
    const auto* p = static_cast<const unsigned char*>(data);
    for (; bytes >= 8; bytes -= 8, p += 8) {
      uint64_t v;
      std::memcpy(&v, p, 8);
      state_ = hashCombine(state_, v);
    }
    uint64_t tail = uint64_t(bytes) << 56;
    std::memcpy(&tail, p, bytes);
    state_ = hashCombine(state_, tail ^ (uint64_t(bytes) << 56));
  }
  void add(const std::string& s) { add(s.data(), s.size()); }
  uint64_t value() const { return state_; }

 private:
  uint64_t state_ = 0x6272616964ull;
};

inline std::string hexString(uint64_t value) {
  static const char* digits = "0123456789abcdef";
  std::string s(16, '0');
  for (int i = 15; i >= 0; --i, value >>= 4) s[static_cast<size_t>(i)] = digits[value & 15];
  return s;
}

}  // namespace braid
