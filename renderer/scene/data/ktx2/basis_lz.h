// SPDX-License-Identifier: Apache-2.0
// BasisLZ: two codebooks that all blocks of a file share, and slices that name two of their entries for every block
// (KTX 2.0, appendices "BasisLZ/ETC1S Bitstream" and "BasisLZ Global Data").
#pragma once

#include "renderer/scene/data/ktx2/huffman.h"

namespace braid::ktx2 {

// A base colour of 5 bits a channel, and which row of ETC1's modifiers.
struct Endpoint {
  uint8_t red, green, blue, modifiers;
};

// Two bits a texel, rows from the top, the left texel in the lowest bits: 0 to 3 from the darkest to the brightest.
using Selector = std::array<uint8_t, 4>;

struct BlockIndices {
  uint16_t endpoint, selector;
};

struct Slice {
  uint32_t offset, bytes;  // in the data of the level; bytes 0: there is none
};

class BasisLz {
 public:
  // Reads the global data. Of the images only the first is looked at: layer 0, face 0 of the largest level.
  explicit BasisLz(Bytes globalData, uint64_t imageCount);

  const std::vector<Endpoint>& endpoints() const { return endpoints_; }
  const std::vector<Selector>& selectors() const { return selectors_; }
  Slice colour() const { return colour_; }
  Slice alpha() const { return alpha_; }

  // The entries of every block of a slice, row by row; all lie in the codebooks.
  std::vector<BlockIndices> decode(Bytes slice, size_t blocksWide, size_t blocksHigh) const;

 private:
  struct Codes {
    HuffmanCode prediction, endpointDelta, selector, selectorRun;
    uint32_t historySize;
  };

  class EndpointDecoder;
  class SelectorDecoder;

  void readEndpoints(Bytes data, size_t count);
  void readSelectors(Bytes data, size_t count);
  static Codes readCodes(Bytes data);

  Slice colour_, alpha_;
  std::vector<Endpoint> endpoints_;
  std::vector<Selector> selectors_;
  std::vector<Codes> codes_;  // one, when it is read
};

}  // namespace braid::ktx2
