// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/local_range_clamp.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "combiners/pixels/window.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr int kTileWidth = 256, kTileHeight = 8;
constexpr float kBrighter = 4, kDarker = 12;  // squared normal deviates: 2² and 3.5²
constexpr float kSlack = 0.1f;

// Widens the range of `count` pixels p by the values of the pixels q that are alike.
struct PairRows {
  const float *noisyP, *noisyQ, *varianceP, *varianceQ, *valueQ;
};
void widen(const PairRows& rows, int count, float* __restrict least, float* __restrict most) {
  const float* __restrict up = rows.noisyP, * __restrict vp = rows.varianceP;
  const float *uq = rows.noisyQ, *vq = rows.varianceQ, *value = rows.valueQ;
  for (int x = 0; x < count; ++x) {
    const float d = up[x] - uq[x];
    const bool alike = d * d <= (d < 0 ? kBrighter : kDarker) * (vp[x] + vq[x]);
    least[x] = alike && value[x] < least[x] ? value[x] : least[x];
    most[x] = alike && value[x] > most[x] ? value[x] : most[x];
  }
}

// One channel of one image in one tile.
void keepTile(Plane<float>& image, const Plane<float>& values, const Plane<float>& noisy, const Plane<float>& variance,
              int radius, const PixelRect& tile) {
  std::vector<float> least(static_cast<size_t>(tile.width())), most(least.size());
  for (int y = tile.y0; y < tile.y1; ++y) {
    std::copy_n(&values.at(tile.x0, y), tile.width(), least.begin());
    most = least;
    for (int v = std::max(0, y - radius); v <= std::min(image.height - 1, y + radius); ++v)
      for (int dx = -radius; dx <= radius; ++dx) {
        const int x0 = std::max(tile.x0, -dx), x1 = std::min(tile.x1, image.width - dx);
        if (x1 <= x0) continue;
        const size_t p = image.index(x0, y), q = image.index(x0 + dx, v), at = static_cast<size_t>(x0 - tile.x0);
        widen({&noisy[p], &noisy[q], &variance[p], &variance[q], &values[q]}, x1 - x0, &least[at], &most[at]);
      }
    for (int x = 0; x < tile.width(); ++x) {
      float& pixel = image.at(tile.x0 + x, y);
      const float low = least[static_cast<size_t>(x)], high = most[static_cast<size_t>(x)];
      pixel = std::clamp(pixel, low - kSlack * std::fabs(low), high + kSlack * std::fabs(high));
    }
  }
}

}  // namespace

void clampToLocalRange(std::span<Rgb<float>* const> images, std::span<const Rgb<float>* const> values,
                       const Rgb<float>& noisy, const Rgb<float>& variance, int radius) {
  BRAID_ASSERT(images.size() == values.size() && radius >= 0);
  forEachTile(noisy.width(), noisy.height(), kTileWidth, kTileHeight, [&](const PixelRect& tile) {
    runVectorised([&] {
      for (size_t k = 0; k < images.size(); ++k)
        for (size_t c = 0; c < 3; ++c) keepTile((*images[k])[c], (*values[k])[c], noisy[c], variance[c], radius, tile);
    });
  });
}

}  // namespace braid
