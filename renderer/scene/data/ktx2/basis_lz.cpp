// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/ktx2/basis_lz.h"

namespace braid::ktx2 {

namespace {

constexpr size_t kHeaderBytes = 20, kImageBytes = 20;

// Numbers in groups of bits, the lowest first; the highest bit of a group says whether another follows.
uint32_t takeVariable(BitReader& in, int groupBits) {
  const uint32_t more = 1u << groupBits;
  uint32_t value = 0;
  for (int shift = 0; shift < 32; shift += groupBits) {
    const uint32_t group = in.take(groupBits + 1);
    value |= (group & (more - 1)) << shift;
    if (!(group & more)) return value;
  }
  failBroken("its compressed data holds a run without an end");
}

}  // namespace

BasisLz::BasisLz(Bytes data, uint64_t imageCount) {
  const auto endpoints = static_cast<size_t>(littleEndian(data, 0, 2));
  const auto selectors = static_cast<size_t>(littleEndian(data, 2, 2));
  if (endpoints == 0 || selectors == 0) failBroken("a codebook is empty");
  const uint64_t endpointBytes = word(data, 4), selectorBytes = word(data, 8), tableBytes = word(data, 12);
  constexpr uint32_t kPFrame = 2;
  if (word(data, kHeaderBytes) & kPFrame) failBroken("its first frame refers to an earlier one");
  colour_ = {word(data, kHeaderBytes + 4), word(data, kHeaderBytes + 8)};
  alpha_ = {word(data, kHeaderBytes + 12), word(data, kHeaderBytes + 16)};
  if (imageCount > data.size() / kImageBytes) failBroken("its global data is cut");
  uint64_t at = kHeaderBytes + kImageBytes * imageCount;
  readEndpoints(part(data, at, endpointBytes, "the codebook of endpoints"), endpoints);
  at += endpointBytes;
  readSelectors(part(data, at, selectorBytes, "the codebook of selectors"), selectors);
  at += selectorBytes;
  codes_.push_back(readCodes(part(data, at, tableBytes, "the list of codes")));
}

void BasisLz::readEndpoints(Bytes data, size_t count) {
  BitReader in(data);
  const HuffmanCode dark = readHuffmanCode(in), middle = readHuffmanCode(in), bright = readHuffmanCode(in);
  const HuffmanCode modifiers = readHuffmanCode(in);
  const bool isGrey = in.take(1) != 0;
  constexpr uint8_t kLastDark = 9, kLastMiddle = 21;
  const auto next = [&](uint8_t last) {
    const HuffmanCode& code = last <= kLastDark ? dark : last <= kLastMiddle ? middle : bright;
    return static_cast<uint8_t>((last + code.decode(in)) & 31);
  };
  Endpoint last{16, 16, 16, 0};
  // One at a time: that there are so many is only claimed.
  for (size_t i = 0; i < count; ++i) {
    last.modifiers = static_cast<uint8_t>((last.modifiers + modifiers.decode(in)) & 7);
    last.red = next(last.red);
    last.green = isGrey ? last.red : next(last.green);
    last.blue = isGrey ? last.red : next(last.blue);
    endpoints_.push_back(last);
  }
}

void BasisLz::readSelectors(Bytes data, size_t count) {
  BitReader in(data);
  if (in.take(2) != 0) failBroken("its selectors are of an unknown kind");
  const bool isPlain = in.take(1) != 0;
  const HuffmanCode delta = isPlain ? HuffmanCode({}) : readHuffmanCode(in);
  Selector last{};
  for (size_t i = 0; i < count; ++i) {
    for (uint8_t& row : last) {
      const bool isWhole = isPlain || i == 0;
      row = static_cast<uint8_t>(isWhole ? in.take(8) : row ^ delta.decode(in));
    }
    selectors_.push_back(last);
  }
}

BasisLz::Codes BasisLz::readCodes(Bytes data) {
  BitReader in(data);
  HuffmanCode prediction = readHuffmanCode(in), endpointDelta = readHuffmanCode(in);
  HuffmanCode selector = readHuffmanCode(in), selectorRun = readHuffmanCode(in);
  return {prediction, endpointDelta, selector, selectorRun, in.take(13)};
}

// The endpoint of a block is that of a neighbour, or given by its distance from the one before. Which of these holds is
// told for 2x2 blocks at once.
class BasisLz::EndpointDecoder {
 public:
  EndpointDecoder(const Codes& codes, size_t endpoints, size_t blocksWide)
      : codes_(codes), endpoints_(endpoints), above_(blocksWide), row_(blocksWide), below_((blocksWide + 1) / 2) {}

  uint16_t decode(BitReader& in, size_t x, size_t y) {
    if (x == 0) std::swap(above_, row_);
    if (x % 2 == 0) predictions_ = y % 2 == 0 ? takePredictions(in, x / 2) : below_[x / 2];
    const uint32_t prediction = predictions_ & 3;
    predictions_ >>= 2;
    last_ = endpoint(in, prediction, x, y);
    row_[x] = last_;
    return last_;
  }

 private:
  enum : uint32_t { kLeft, kAbove, kAboveLeft, kDelta };

  uint32_t takePredictions(BitReader& in, size_t group) {
    constexpr uint32_t kRepeat = 256, kLeastRepeats = 3;
    if (repeats_ > 0) {
      --repeats_;
    } else {
      const uint32_t symbol = codes_.prediction.decode(in);
      if (symbol > kRepeat) failBroken("its compressed data holds an unknown prediction");
      if (symbol == kRepeat)
        repeats_ = uint64_t(takeVariable(in, 4)) + kLeastRepeats - 1;
      else
        lastPredictions_ = symbol;
    }
    below_[group] = static_cast<uint8_t>(lastPredictions_ >> 4);
    return lastPredictions_;
  }

  uint16_t endpoint(BitReader& in, uint32_t prediction, size_t x, size_t y) const {
    if (prediction == kDelta) {
      size_t index = last_ + codes_.endpointDelta.decode(in);
      if (index >= endpoints_) index -= endpoints_;
      if (index >= endpoints_) failBroken("a block has an endpoint outside the codebook");
      return static_cast<uint16_t>(index);
    }
    if ((prediction != kAbove && x == 0) || (prediction != kLeft && y == 0))
      failBroken("a block repeats a neighbour outside the picture");
    if (prediction == kLeft) return last_;
    return prediction == kAbove ? above_[x] : above_[x - 1];
  }

  const Codes& codes_;
  size_t endpoints_;
  std::vector<uint16_t> above_, row_;  // endpoints of the row above and of this one
  std::vector<uint8_t> below_;         // predictions of the blocks below, two bits each
  uint32_t predictions_ = 0, lastPredictions_ = 0;
  uint64_t repeats_ = 0;
  uint16_t last_ = 0;
};

// The selector of a block is told outright or as a place in the history; runs repeat the first place.
class BasisLz::SelectorDecoder {
 private:
  // What was used lately comes to the front, by half of its way; what is new enters in the middle.
  class History {
   public:
    explicit History(size_t size) : values_(size), next_(size / 2) {}

    size_t size() const { return values_.size(); }

    uint16_t use(size_t index) {
      const uint16_t value = values_[index];
      std::swap(values_[index / 2], values_[index]);
      return value;
    }

    void add(uint16_t value) {
      if (values_.empty()) return;
      values_[next_++] = value;
      if (next_ == values_.size()) next_ = values_.size() / 2;
    }

   private:
    std::vector<uint16_t> values_;
    size_t next_;
  };

 public:
  SelectorDecoder(const Codes& codes, size_t selectors)
      : codes_(codes), selectors_(selectors), history_(codes.historySize) {}

  uint16_t decode(BitReader& in) {
    size_t symbol = selectors_;
    if (run_ > 0) {
      --run_;
    } else {
      symbol = codes_.selector.decode(in);
      if (symbol == selectors_ + history_.size()) {
        run_ = takeRun(in) - 1;
        symbol = selectors_;
      }
    }
    if (symbol < selectors_) {
      history_.add(static_cast<uint16_t>(symbol));
      return static_cast<uint16_t>(symbol);
    }
    if (symbol - selectors_ >= history_.size()) failBroken("a block has a selector outside the codebook");
    return history_.use(symbol - selectors_);
  }

 private:
  uint64_t takeRun(BitReader& in) const {
    constexpr uint32_t kLong = 63, kLeastRun = 3;
    const uint32_t symbol = codes_.selectorRun.decode(in);
    return uint64_t(symbol == kLong ? takeVariable(in, 7) : symbol) + kLeastRun;
  }

  const Codes& codes_;
  size_t selectors_;
  History history_;
  uint64_t run_ = 0;
};

std::vector<BlockIndices> BasisLz::decode(Bytes slice, size_t blocksWide, size_t blocksHigh) const {
  BitReader in(slice);
  EndpointDecoder endpoints(codes_.front(), endpoints_.size(), blocksWide);
  SelectorDecoder selectors(codes_.front(), selectors_.size());
  std::vector<BlockIndices> blocks;
  blocks.reserve(blocksWide * blocksHigh);
  for (size_t y = 0; y < blocksHigh; ++y) {
    for (size_t x = 0; x < blocksWide; ++x) {
      const uint16_t endpoint = endpoints.decode(in, x, y);
      blocks.push_back({endpoint, selectors.decode(in)});
    }
  }
  return blocks;
}

}  // namespace braid::ktx2
