// SPDX-License-Identifier: Apache-2.0
// What a tile of the output takes of every layer, and where that lies in memory.
//
// Each layer is worked out over the pixels that the tile needs and no others, found backwards from the output: a
// convolution needs one more pixel on each side, pooling twice as many, upsampling half. Beyond the image there is
// nothing: convolutions put zeros there, in every tile where the whole image would have them. So the tile holds what
// the network on the whole image gives it.
#pragma once

#include <cstddef>
#include <vector>

#include "combiners/learned/convolution.h"
#include "combiners/learned/network.h"

namespace braid {

// Half open, in pixels of a tensor's level.
struct TileRegion {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  size_t pixels() const { return static_cast<size_t>(width()) * static_cast<size_t>(height()); }
};

struct TilePlan {
  struct Tensor {
    TileRegion region;
    int blocks = 0;     // of channels
    size_t offset = 0;  // of its first value in the memory of the tile
    size_t values = 0;
  };
  std::vector<Tensor> tensors;         // as in the graph
  std::vector<ConvolutionSize> sizes;  // of each layer that is a convolution
  size_t values = 0;                   // floats in all
};

// `slots` of a tensor: where each of its channels lies among those of its blocks.
std::vector<std::vector<int>> channelSlots(const Network& network, const NetworkGraph& graph, int block);

// Of an image whose size is a multiple of 2^levels, as are the coordinates of the tile.
TilePlan planTile(const Network& network, const NetworkGraph& graph, const TileRegion& tile, const TileRegion& image,
                  int block);

}  // namespace braid
