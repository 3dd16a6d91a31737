// SPDX-License-Identifier: Apache-2.0
// Regions of blocked tensors (combiners/learned/convolution.h), and what needs no arithmetic with weights.
#pragma once

#include "combiners/learned/tile_plan.h"

namespace braid {

struct BlockedTensor {
  float* values = nullptr;
  TileRegion region;
  int blocks = 0, block = 0;

  // The first channel of a block of the pixel.
  float* at(int b, int x, int y) const {
    const size_t pixel =
        static_cast<size_t>(y - region.y0) * static_cast<size_t>(region.width()) + static_cast<size_t>(x - region.x0);
    return values + (static_cast<size_t>(b) * region.pixels() + pixel) * static_cast<size_t>(block);
  }
};

// Each fills the whole region of `out`, of which `in` holds what is needed; the last two those blocks of it from
// `first` on that `in` has.
void maxPool(const BlockedTensor& in, const BlockedTensor& out);
void upsample(const BlockedTensor& in, const BlockedTensor& out, int first);
void copyBlocks(const BlockedTensor& in, const BlockedTensor& out, int first);

// A row of `channels` values a pixel from the left end of the region on; the channels beyond become zeros.
void setRow(const BlockedTensor& out, int y, const float* row, int channels);
// The pixels [x0, x1) of a row.
void getRow(const BlockedTensor& in, int y, int x0, int x1, float* row, int channels);

}  // namespace braid
