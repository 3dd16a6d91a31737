// SPDX-License-Identifier: Apache-2.0
// Bytes and bits of a file, of which nothing is read outside its bounds.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "renderer/core/error.h"

namespace braid::ktx2 {

using Bytes = std::span<const uint8_t>;

[[noreturn]] inline void failBroken(const std::string& what) {
  throw Error(ExitCode::BadInput, "is a broken KTX2 image (" + what + "); save it again");
}

[[noreturn]] inline void failUnsupported(const std::string& what) {
  throw Error(ExitCode::BadInput,
              "is a KTX2 image " + what + ", which is not supported; save it as UASTC, ETC1S or PNG");
}

// `bytes` at `offset`; `what` names them in the message when they do not lie in `data`.
inline Bytes part(Bytes data, uint64_t offset, uint64_t bytes, const char* what) {
  if (offset > data.size() || bytes > data.size() - offset) failBroken(std::string(what) + " lies outside the file");
  return data.subspan(static_cast<size_t>(offset), static_cast<size_t>(bytes));
}

// Little-endian, of `bytes` bytes; an offset beyond the data is refused.
inline uint64_t littleEndian(Bytes data, size_t offset, size_t bytes) {
  if (offset > data.size() || bytes > data.size() - offset) failBroken("its header is cut");
  uint64_t value = 0;
  for (size_t i = bytes; i-- > 0;) value = value << 8 | data[offset + i];
  return value;
}

inline uint32_t word(Bytes data, size_t offset) { return static_cast<uint32_t>(littleEndian(data, offset, 4)); }
inline uint64_t longWord(Bytes data, size_t offset) { return littleEndian(data, offset, 8); }

// A stream of bits, the least significant bit of every byte first.
class BitReader {
 public:
  explicit BitReader(Bytes data) : next_(data.data()), end_(data.data() + data.size()) {}

  // The next bits, at most 24, without taking them; behind the end there are zeros.
  uint32_t peek(int bits) {
    if (held_ < bits) fill();
    return static_cast<uint32_t>(bits_ & ((uint64_t(1) << bits) - 1));
  }

  // Takes bits that were peeked at. Those behind the end cannot be taken: the stream is cut.
  void skip(int bits) {
    bits_ >>= bits;
    held_ -= bits;
    if (held_ < padded_) failBroken("its compressed data ends too early");
  }

  uint32_t take(int bits) {
    const uint32_t value = peek(bits);
    skip(bits);
    return value;
  }

 private:
  void fill() {
    for (; held_ <= 56; held_ += 8) {
      if (next_ != end_)
        bits_ |= uint64_t(*next_++) << held_;
      else
        padded_ += 8;
    }
  }

  const uint8_t *next_, *end_;
  uint64_t bits_ = 0;
  int held_ = 0, padded_ = 0;  // bits in bits_; of those, how many lie behind the end
};

}  // namespace braid::ktx2
