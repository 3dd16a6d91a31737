// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/blocked_tensor.h"

#include <algorithm>
#include <type_traits>

namespace braid {

namespace {

// Calls body with the channels of a block as a constant, of the two that processors like.
template <class Body>
void withBlock(int block, const Body& body) {
  if (block == 16)
    body(std::integral_constant<int, 16>());
  else if (block == 8)
    body(std::integral_constant<int, 8>());
  else
    body(block);
}

}  // namespace

void maxPool(const BlockedTensor& in, const BlockedTensor& out) {
  withBlock(out.block, [&](auto block) {
    for (int b = 0; b < out.blocks; ++b)
      for (int y = out.region.y0; y < out.region.y1; ++y) {
        const float *above = in.at(b, 2 * out.region.x0, 2 * y), *below = in.at(b, 2 * out.region.x0, 2 * y + 1);
        float* to = out.at(b, out.region.x0, y);
        for (int x = 0; x < out.region.width(); ++x, above += 2 * block, below += 2 * block, to += block)
          for (int c = 0; c < block; ++c)
            to[c] = std::max(std::max(above[c], above[c + block]), std::max(below[c], below[c + block]));
      }
  });
}

void upsample(const BlockedTensor& in, const BlockedTensor& out, int first) {
  withBlock(out.block, [&](auto block) {
    for (int b = 0; b < in.blocks; ++b)
      for (int y = out.region.y0; y < out.region.y1; ++y) {
        float* to = out.at(first + b, out.region.x0, y);
        const float* row = in.at(b, in.region.x0, y / 2);
        for (int x = out.region.x0; x < out.region.x1; ++x, to += block)
          std::copy_n(row + (x / 2 - in.region.x0) * block, block, to);
      }
  });
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
