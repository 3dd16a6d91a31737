// SPDX-License-Identifier: Apache-2.0
// Blocks of texels and the picture that they fill.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "renderer/core/parallel.h"

namespace braid::ktx2 {

using Texel = std::array<uint8_t, 4>;  // red, green, blue, alpha

constexpr size_t kBlock = 4;  // texels along a side of a block

using Block = std::array<Texel, kBlock * kBlock>;  // rows from the top

// RGBA of 8 bits, row 0 first in the file.
struct ByteTexels {
  size_t width, height;
  std::vector<uint8_t> rgba;

  ByteTexels(size_t w, size_t h) : width(w), height(h), rgba(w * h * 4) {}
};

inline size_t blocksAlong(size_t texels) { return (texels + kBlock - 1) / kBlock; }

// Fills the picture with decode(index), whose blocks stand row by row; what sticks out of the picture is cut off.
template <class Decode>
void fillWithBlocks(ByteTexels& picture, const Decode& decode) {
  const size_t across = blocksAlong(picture.width);
  parallelFor(blocksAlong(picture.height), [&](size_t blockRow) {
    const size_t top = blockRow * kBlock, rows = std::min(kBlock, picture.height - top);
    for (size_t column = 0; column < across; ++column) {
      const Block block = decode(blockRow * across + column);
      const size_t left = column * kBlock, columns = std::min(kBlock, picture.width - left);
      for (size_t y = 0; y < rows; ++y)
        std::memcpy(&picture.rgba[((top + y) * picture.width + left) * 4], &block[y * kBlock], columns * 4);
    }
  });
}

}  // namespace braid::ktx2
