// SPDX-License-Identifier: Apache-2.0
// Per-pixel values averaged over the channels.
#pragma once

#include "combiners/pixels/finite_float.h"
#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"

namespace braid {

// (map(i, 0) + map(i, 1) + map(i, 2)) / 3 for every pixel i of an image of this size.
template <class Map>
Plane<float> channelMean(int width, int height, const Map& map) {
  Plane<float> out(width, height, kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      out[i] = finiteFloat((map(i, size_t(0)) + map(i, size_t(1)) + map(i, size_t(2))) / 3);
  });
  return out;
}
template <class Map>
Plane<float> channelMean(const Rgb<float>& like, const Map& map) {
  return channelMean(like.width(), like.height(), map);
}

// The channel mean of an image.
inline Plane<float> channelMean(const Rgb<float>& image) {
  return channelMean(image, [&image](size_t i, size_t c) { return static_cast<double>(image[c][i]); });
}

}  // namespace braid
