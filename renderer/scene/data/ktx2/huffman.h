// SPDX-License-Identifier: Apache-2.0
// Canonical Huffman codes as BasisLZ stores them (KTX 2.0, appendix "BasisLZ/ETC1S Bitstream", Compressed Huffman
// Tables; the order of codes is that of RFC 1951, 3.2.2).
#pragma once

#include <array>
#include <vector>

#include "renderer/scene/data/ktx2/bytes.h"

namespace braid::ktx2 {

constexpr int kLongestCode = 16;

class HuffmanCode {
 public:
  // From the length in bits of every symbol's code, 0 for symbols that do not occur, at most kLongestCode. Refuses more
  // codes than fit. None at all are accepted: such a code decodes nothing.
  explicit HuffmanCode(const std::vector<uint8_t>& lengths);

  // The next symbol; refuses bits that are no code.
  uint32_t decode(BitReader& in) const {
    const Entry entry = short_[in.peek(kShort)];
    if (entry.length == 0) return decodeLong(in);
    in.skip(entry.length);
    return entry.symbol;
  }

 private:
  static constexpr int kShort = 10;  // bits that one look-up decodes

  struct Entry {
    uint16_t symbol = 0;
    uint8_t length = 0;  // 0: longer than kShort, or no code
  };

  uint32_t decodeLong(BitReader& in) const;

  std::array<Entry, size_t(1) << kShort> short_;
  std::array<uint32_t, kLongestCode + 1> count_{}, firstCode_{}, firstSymbol_{};  // of every length
  std::vector<uint16_t> symbols_;                                                 // in the order of their codes
};

// A code whose lengths are stored run-length encoded under a code of their own.
HuffmanCode readHuffmanCode(BitReader& in);

}  // namespace braid::ktx2
