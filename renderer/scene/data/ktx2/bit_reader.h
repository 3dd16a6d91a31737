// SPDX-License-Identifier: Apache-2.0
// A stream of bits, the least significant bit of every byte first.
#pragma once

#include "renderer/scene/data/ktx2/bytes.h"

namespace braid::ktx2 {

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
