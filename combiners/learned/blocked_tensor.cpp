// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/blocked_tensor.h"

#include <algorithm>

namespace braid {

namespace {

// The greater one; a value that is no number stays one.
void mostOfFour(const float* above, const float* below, float* out, int block) {
  for (int c = 0; c < block; ++c) {
    const float one = std::max(above[c], above[block + c]), other = std::max(below[c], below[block + c]);
    out[c] = std::max(one, other);
  }
}

}  // namespace

void maxPool(const BlockedTensor& in, const BlockedTensor& out) {
  for (int b = 0; b < out.blocks; ++b)
    for (int y = out.region.y0; y < out.region.y1; ++y)
      for (int x = out.region.x0; x < out.region.x1; ++x)
        mostOfFour(in.at(b, 2 * x, 2 * y), in.at(b, 2 * x, 2 * y + 1), out.at(b, x, y), out.block);
}

void upsample(const BlockedTensor& in, const BlockedTensor& out) {
  for (int b = 0; b < out.blocks; ++b)
    for (int y = out.region.y0; y < out.region.y1; ++y)
      for (int x = out.region.x0; x < out.region.x1; ++x)
        std::copy_n(in.at(b, x / 2, y / 2), out.block, out.at(b, x, y));
}

void copyBlocks(const BlockedTensor& in, const BlockedTensor& out, int first) {
  const auto row = static_cast<size_t>(out.region.width() * out.block);
  for (int b = 0; b < in.blocks; ++b)
    for (int y = out.region.y0; y < out.region.y1; ++y)
      std::copy_n(in.at(b, out.region.x0, y), row, out.at(first + b, out.region.x0, y));
}

void setRow(const BlockedTensor& out, int y, const float* row, int channels) {
  for (int x = out.region.x0; x < out.region.x1; ++x, row += channels)
    for (int b = 0; b < out.blocks; ++b) {
      float* to = out.at(b, x, y);
      const int left = std::clamp(channels - b * out.block, 0, out.block);
      std::copy_n(row + std::min(channels, b * out.block), left, to);
      std::fill(to + left, to + out.block, 0.0f);
    }
}

void getRow(const BlockedTensor& in, int y, int x0, int x1, float* row, int channels) {
  for (int x = x0; x < x1; ++x, row += channels)
    for (int b = 0; b * in.block < channels; ++b)
      std::copy_n(in.at(b, x, y), std::min(in.block, channels - b * in.block), row + b * in.block);
}

}  // namespace braid
