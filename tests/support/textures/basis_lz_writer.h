// SPDX-License-Identifier: Apache-2.0
// Writes BasisLZ data for tests: Huffman tables, codebooks and slices (KTX 2.0, appendix "BasisLZ/ETC1S Bitstream").
#pragma once

#include <array>
#include <random>

#include "tests/support/textures/ktx2_writer.h"

namespace braid::test {

// Canonical codes of given lengths.
class HuffmanWriter {
 public:
  explicit HuffmanWriter(std::vector<uint8_t> lengths) : lengths_(std::move(lengths)), codes_(lengths_.size()) {
    uint32_t code = 0;
    for (uint8_t length = 1; length <= 16; ++length, code <<= 1)
      for (size_t symbol = 0; symbol < lengths_.size(); ++symbol)
        if (lengths_[symbol] == length) codes_[symbol] = code++;
  }

  // All of so many symbols, and as many more as make the code complete.
  static HuffmanWriter flat(size_t symbols) {
    uint8_t length = 1;
    while (size_t(1) << length < symbols) ++length;
    return HuffmanWriter(std::vector<uint8_t>(size_t(1) << length, length));
  }

  // Codes of many lengths, up to 16: each symbol takes half of what is left, from a random one on.
  static HuffmanWriter uneven(size_t symbols, std::mt19937& random) {
    std::vector<size_t> order(symbols);
    for (size_t i = 0; i < symbols; ++i) order[i] = i;
    std::shuffle(order.begin(), order.end(), random);
    std::vector<uint8_t> lengths(symbols);
    // Leaves of a tree, split until there are enough.
    std::vector<uint8_t> leaves = {1, 1};
    while (leaves.size() < symbols) {
      const size_t split = leaves.back() < 15 ? leaves.size() - 1 : random() % leaves.size();
      if (leaves[split] >= 16) continue;
      const auto longer = static_cast<uint8_t>(leaves[split] + 1);
      leaves[split] = longer;
      leaves.push_back(longer);
    }
    for (size_t i = 0; i < symbols; ++i) lengths[order[i]] = leaves[i];
    return HuffmanWriter(lengths);
  }

  void put(BitWriter& out, size_t symbol) const {
    for (int i = lengths_[symbol]; i-- > 0;) out.put(codes_[symbol] >> i & 1, 1);
  }

  // The lengths under a code of their own: 11 symbols of 4 bits, 10 of 5.
  void putTable(BitWriter& out) const {
    static const HuffmanWriter lengthCode = [] {
      std::vector<uint8_t> lengths(21, 5);
      std::fill_n(lengths.begin(), 11, uint8_t(4));
      return HuffmanWriter(lengths);
    }();
    out.put(static_cast<uint32_t>(lengths_.size()), 14);
    out.put(21, 5);
    for (const size_t symbol : {17, 18, 19, 20, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15, 16})
      out.put(lengthCode.lengths_[symbol], 3);
    for (size_t i = 0; i < lengths_.size();) {
      const size_t run = runAt(i);
      const bool isZero = lengths_[i] == 0, repeats = !isZero && i > 0 && lengths_[i - 1] == lengths_[i];
      i += isZero ? putZeros(out, lengthCode, run) : repeats ? putRepeats(out, lengthCode, run) : 0;
      if (run >= 3 && (isZero || repeats)) continue;
      lengthCode.put(out, lengths_[i]);
      ++i;
    }
  }

 private:
  size_t runAt(size_t first) const {
    size_t end = first;
    while (end < lengths_.size() && lengths_[end] == lengths_[first]) ++end;
    return end - first;
  }

  // How many symbols the run that was put stands for; 0: it is too short for one.
  static size_t putRun(BitWriter& out, const HuffmanWriter& code, size_t symbol, size_t run, size_t least, int bits) {
    const size_t stands = std::min(run, least + (size_t(1) << bits) - 1);
    code.put(out, symbol);
    out.put(static_cast<uint32_t>(stands - least), bits);
    return stands;
  }
  static size_t putZeros(BitWriter& out, const HuffmanWriter& code, size_t run) {
    if (run < 3) return 0;
    return run < 11 ? putRun(out, code, 17, run, 3, 3) : putRun(out, code, 18, run, 11, 7);
  }
  static size_t putRepeats(BitWriter& out, const HuffmanWriter& code, size_t run) {
    if (run < 3) return 0;
    return run < 7 ? putRun(out, code, 19, run, 3, 2) : putRun(out, code, 20, run, 7, 7);
  }

  std::vector<uint8_t> lengths_;
  std::vector<uint32_t> codes_;
};

struct WrittenEndpoint {
  int red, green, blue, modifiers;
};
using WrittenSelector = std::array<int, 16>;  // of every texel, 0 to 3

inline ByteVector writeEndpoints(const std::vector<WrittenEndpoint>& endpoints, bool grey) {
  BitWriter out;
  const HuffmanWriter colour = HuffmanWriter::flat(32), modifiers = HuffmanWriter::flat(8);
  for (int i = 0; i < 3; ++i) colour.putTable(out);
  modifiers.putTable(out);
  out.put(grey, 1);
  WrittenEndpoint last{16, 16, 16, 0};
  for (const WrittenEndpoint& e : endpoints) {
    modifiers.put(out, static_cast<size_t>((e.modifiers - last.modifiers) & 7));
    colour.put(out, static_cast<size_t>((e.red - last.red) & 31));
    if (!grey) colour.put(out, static_cast<size_t>((e.green - last.green) & 31));
    if (!grey) colour.put(out, static_cast<size_t>((e.blue - last.blue) & 31));
    last = e;
  }
  return out.bytes();
}

inline ByteVector writeSelectors(const std::vector<WrittenSelector>& selectors, bool plain) {
  BitWriter out;
  out.put(0, 2);
  out.put(plain, 1);
  const HuffmanWriter delta = HuffmanWriter::flat(256);
  if (!plain) delta.putTable(out);
  std::array<uint32_t, 4> last{};
  for (size_t i = 0; i < selectors.size(); ++i)
    for (size_t y = 0; y < 4; ++y) {
      uint32_t row = 0;
      for (size_t x = 0; x < 4; ++x) row |= static_cast<uint32_t>(selectors[i][4 * y + x]) << (2 * x);
      if (plain || i == 0)
        out.put(row, 8);
      else
        delta.put(out, row ^ last[y]);
      last[y] = row;
    }
  return out.bytes();
}

// The codes of all slices of a file, and slices written with them.
class SliceWriter {
 public:
  struct Block {
    size_t endpoint, selector;
  };

  SliceWriter(size_t endpoints, size_t selectors, size_t history, std::mt19937& random)
      : endpoints_(endpoints),
        selectors_(selectors),
        historySize_(history),
        prediction_(HuffmanWriter::uneven(257, random)),
        delta_(HuffmanWriter::flat(endpoints)),
        selector_(HuffmanWriter::uneven(selectors + history + 1, random)),
        run_(HuffmanWriter::flat(64)) {}

  ByteVector tables() const {
    BitWriter out;
    for (const HuffmanWriter* code : {&prediction_, &delta_, &selector_, &run_}) code->putTable(out);
    out.put(static_cast<uint32_t>(historySize_), 13);
    return out.bytes();
  }

  // Blocks row by row. Endpoints are told by the first neighbour that has the same one, else by their distance.
  ByteVector slice(const std::vector<Block>& blocks, size_t wide, size_t high) const {
    const std::vector<uint32_t> predictions = predictionsOf(blocks, wide, high);
    BitWriter out;
    std::vector<size_t> history(historySize_);
    size_t rover = historySize_ / 2, last = 0, lastSymbol = 0, repeats = 0, run = 0;
    for (size_t i = 0; i < blocks.size(); ++i) {
      const size_t x = i % wide, y = i / wide;
      if (x % 2 == 0 && y % 2 == 0) putGroup(out, predictions, {x, y, wide, high}, lastSymbol, repeats);
      if (predictions[i] == 3) delta_.put(out, (blocks[i].endpoint + endpoints_ - last) % endpoints_);
      last = blocks[i].endpoint;
      if (run > 0) {
        --run;
        continue;
      }
      run = putSelector(out, blocks, i, history, rover);
    }
    return out.bytes();
  }

 private:
  struct Group {
    size_t x, y, wide, high;
  };

  static std::vector<uint32_t> predictionsOf(const std::vector<Block>& blocks, size_t wide, size_t high) {
    std::vector<uint32_t> predictions(blocks.size(), 3);
    for (size_t y = 0; y < high; ++y)
      for (size_t x = 0; x < wide; ++x) {
        const size_t i = y * wide + x, endpoint = blocks[i].endpoint;
        if (x > 0 && y > 0 && blocks[i - wide - 1].endpoint == endpoint) predictions[i] = 2;
        if (y > 0 && blocks[i - wide].endpoint == endpoint) predictions[i] = 1;
        if (x > 0 && blocks[i - 1].endpoint == endpoint) predictions[i] = 0;
      }
    return predictions;
  }

  static uint32_t symbolAt(const std::vector<uint32_t>& predictions, const Group& g) {
    uint32_t symbol = 0;
    for (size_t k = 0; k < 4; ++k) {
      const size_t x = g.x + k % 2, y = g.y + k / 2;
      if (x < g.wide && y < g.high) symbol |= predictions[y * g.wide + x] << (2 * k);
    }
    return symbol;
  }

  static void putVariable(BitWriter& out, size_t value, int bits) {
    for (;; value >>= bits) {
      const bool more = value >> bits != 0;
      out.put(static_cast<uint32_t>(value & ((1u << bits) - 1)) | static_cast<uint32_t>(more) << bits, bits + 1);
      if (!more) return;
    }
  }

  void putGroup(BitWriter& out, const std::vector<uint32_t>& predictions, Group g, size_t& last,
                size_t& repeats) const {
    if (repeats > 0) {
      --repeats;
      return;
    }
    const uint32_t symbol = symbolAt(predictions, g);
    size_t same = 0;
    for (Group next = g; next.y < g.high && symbolAt(predictions, next) == last; ++same) {
      next.x += 2;
      if (next.x >= g.wide) next = {0, next.y + 2, g.wide, g.high};
    }
    if (same >= 3) {
      prediction_.put(out, 256);
      putVariable(out, same - 3, 4);
      repeats = same - 1;
      return;
    }
    prediction_.put(out, symbol);
    last = symbol;
  }

  // How many further blocks a run covers.
  size_t putSelector(BitWriter& out, const std::vector<Block>& blocks, size_t i, std::vector<size_t>& history,
                     size_t& rover) const {
    const size_t wanted = blocks[i].selector;
    size_t same = 0;
    while (historySize_ > 0 && i + same < blocks.size() && blocks[i + same].selector == history[0]) ++same;
    if (same >= 3) {
      selector_.put(out, selectors_ + historySize_);
      run_.put(out, std::min<size_t>(same - 3, 63));
      if (same - 3 >= 63) putVariable(out, same - 3, 7);
      return same - 1;
    }
    for (size_t k = 0; k < historySize_; ++k) {
      if (history[k] != wanted) continue;
      selector_.put(out, selectors_ + k);
      if (k > 0) std::swap(history[k], history[k / 2]);
      return 0;
    }
    selector_.put(out, wanted);
    if (historySize_ == 0) return 0;
    history[rover++] = wanted;
    if (rover == historySize_) rover = historySize_ / 2;
    return 0;
  }

  size_t endpoints_, selectors_, historySize_;
  HuffmanWriter prediction_, delta_, selector_, run_;
};

// Global data for one image whose level holds the colour slice and behind it, if it has bytes, the alpha slice.
inline ByteVector globalData(const std::vector<ByteVector>& parts, size_t endpoints, size_t selectors,
                             size_t colourBytes, size_t alphaBytes) {
  ByteVector out;
  appendNumber(out, endpoints, 2);
  appendNumber(out, selectors, 2);
  for (const ByteVector& part : parts) appendNumber(out, part.size(), 4);
  appendNumber(out, 0, 4);  // extended data
  appendNumber(out, 0, 4);  // flags
  appendNumber(out, 0, 4);
  appendNumber(out, colourBytes, 4);
  appendNumber(out, alphaBytes > 0 ? colourBytes : 0, 4);
  appendNumber(out, alphaBytes, 4);
  for (const ByteVector& part : parts) append(out, part);
  return out;
}

}  // namespace braid::test
