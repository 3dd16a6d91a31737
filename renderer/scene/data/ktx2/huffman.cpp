// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/ktx2/huffman.h"

namespace braid::ktx2 {

namespace {

// Codes are sent from their most significant bit, values from their least.
uint32_t reversed(uint32_t code, int bits) {
  uint32_t result = 0;
  for (int i = 0; i < bits; ++i) result |= ((code >> i) & 1) << (bits - 1 - i);
  return result;
}

// Symbols of the code lengths beyond the lengths 0 to 16 themselves.
enum : uint32_t { kShortZeros = 17, kLongZeros = 18, kShortRepeat = 19, kLongRepeat = 20 };

HuffmanCode readLengthCode(BitReader& in) {
  constexpr std::array<uint8_t, 21> kOrder = {17, 18, 19, 20, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15, 16};
  const uint32_t count = in.take(5);
  if (count < 1 || count > kOrder.size()) failBroken("a Huffman table has " + std::to_string(count) + " code lengths");
  std::vector<uint8_t> lengths(kOrder.size());
  for (uint32_t i = 0; i < count; ++i) lengths[kOrder[i]] = static_cast<uint8_t>(in.take(3));
  return HuffmanCode(lengths);
}

}  // namespace

HuffmanCode::HuffmanCode(const std::vector<uint8_t>& lengths) {
  for (const uint8_t length : lengths) ++count_[length];
  count_[0] = 0;
  uint32_t code = 0, symbols = 0;
  for (size_t length = 1; length <= kLongestCode; ++length) {
    code = (code + count_[length - 1]) << 1;
    if (code + count_[length] > uint32_t(1) << length) failBroken("a Huffman table has too many codes");
    firstCode_[length] = code;
    firstSymbol_[length] = symbols;
    symbols += count_[length];
  }
  symbols_.resize(symbols);
  std::array<uint32_t, kLongestCode + 1> used{};
  for (size_t symbol = 0; symbol < lengths.size(); ++symbol) {
    const uint8_t length = lengths[symbol];
    if (length == 0) continue;
    const uint32_t rank = used[length]++;
    symbols_[firstSymbol_[length] + rank] = static_cast<uint16_t>(symbol);
    if (length > kShort) continue;
    // All bits that may follow the code.
    for (uint32_t bits = reversed(firstCode_[length] + rank, length); bits < short_.size(); bits += 1u << length)
      short_[bits] = {static_cast<uint16_t>(symbol), length};
  }
}

uint32_t HuffmanCode::decodeLong(BitReader& in) const {
  const uint32_t bits = in.peek(kLongestCode);
  uint32_t code = reversed(bits & ((1u << kShort) - 1), kShort);
  for (int length = kShort + 1; length <= kLongestCode; ++length) {
    code = code << 1 | (bits >> (length - 1) & 1);
    const auto l = static_cast<size_t>(length);
    if (code >= firstCode_[l] && code - firstCode_[l] < count_[l]) {
      in.skip(length);
      return symbols_[firstSymbol_[l] + code - firstCode_[l]];
    }
  }
  failBroken("its compressed data holds bits that are no code");
}

HuffmanCode readHuffmanCode(BitReader& in) {
  const uint32_t count = in.take(14);
  std::vector<uint8_t> lengths;
  if (count == 0) return HuffmanCode(lengths);
  const HuffmanCode lengthCode = readLengthCode(in);
  lengths.reserve(count);
  while (lengths.size() < count) {
    const uint32_t symbol = lengthCode.decode(in);
    uint32_t run = 1;
    uint8_t length = static_cast<uint8_t>(symbol);
    if (symbol >= kShortZeros) {
      if (symbol == kShortZeros) run = 3 + in.take(3);
      if (symbol == kLongZeros) run = 11 + in.take(7);
      if (symbol == kShortRepeat) run = 3 + in.take(2);
      if (symbol == kLongRepeat) run = 7 + in.take(7);
      const bool repeats = symbol >= kShortRepeat;
      if (repeats && (lengths.empty() || lengths.back() == 0)) failBroken("a Huffman table repeats no length");
      length = repeats ? lengths.back() : uint8_t(0);
    }
    if (run > count - lengths.size()) failBroken("a Huffman table has too many lengths");
    lengths.insert(lengths.end(), run, length);
  }
  return HuffmanCode(lengths);
}

}  // namespace braid::ktx2
