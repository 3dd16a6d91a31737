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
constexpr float kAlone = 1;  // pixels alike: the pixel itself

// Widens the range of `count` pixels p by the values of the pixels q that are alike, and counts these.
struct PairRows {
  const float *noisyP, *noisyQ, *varianceP, *varianceQ, *valueQ;
};
struct RangeRows {
  float *least, *most, *alike;
};
void widen(const PairRows& rows, int count, float brighter, const RangeRows& range) {
  const float* __restrict up = rows.noisyP, * __restrict vp = rows.varianceP;
  const float *uq = rows.noisyQ, *vq = rows.varianceQ, *value = rows.valueQ;
  float* __restrict least = range.least, * __restrict most = range.most, * __restrict number = range.alike;
  for (int x = 0; x < count; ++x) {
    const float d = up[x] - uq[x];
    const bool alike = d * d <= (d < 0 ? brighter : kDarker) * (vp[x] + vq[x]);
    least[x] = alike && value[x] < least[x] ? value[x] : least[x];
    most[x] = alike && value[x] > most[x] ? value[x] : most[x];
    number[x] += alike ? 1.0f : 0.0f;
  }
}

// One channel of an image of values, and of the noisy one.
struct Channel {
  const Plane<float>&values, &noisy, &variance;
};

// Widens the range of the pixels [from, to) of row y by those of their windows. `range` begins with the first of them.
void widenByWindows(const Channel& of, int radius, int from, int to, int y, float brighter, const RangeRows& range) {
  const Plane<float>& noisy = of.noisy;
  for (int v = std::max(0, y - radius); v <= std::min(noisy.height - 1, y + radius); ++v)
    for (int dx = -radius; dx <= radius; ++dx) {
      const int x0 = std::max(from, -dx), x1 = std::min(to, noisy.width - dx);
      if (x1 <= x0) continue;
      const size_t p = noisy.index(x0, y), q = noisy.index(x0 + dx, v), at = static_cast<size_t>(x0 - from);
      widen({&noisy[p], &noisy[q], &of.variance[p], &of.variance[q], &of.values[q]}, x1 - x0, brighter,
            {range.least + at, range.most + at, range.alike + at});
    }
}

// One channel of one image in one tile.
void keepTile(Plane<float>& image, const Channel& of, int radius, const PixelRect& tile) {
  std::vector<float> least(static_cast<size_t>(tile.width())), most(least.size()), alike(least.size());
  for (int y = tile.y0; y < tile.y1; ++y) {
    std::copy_n(&of.values.at(tile.x0, y), tile.width(), least.begin());
    most = least;
    std::ranges::fill(alike, 0.0f);
    widenByWindows(of, radius, tile.x0, tile.x1, y, kBrighter, {least.data(), most.data(), alike.data()});
    for (int x = 0; x < tile.width(); ++x) {
      const auto i = static_cast<size_t>(x);
      if (alike[i] <= kAlone)
        widenByWindows(of, radius, tile.x0 + x, tile.x0 + x + 1, y, kDarker, {&least[i], &most[i], &alike[i]});
      float& pixel = image.at(tile.x0 + x, y);
      pixel = std::clamp(pixel, least[i] - kSlack * std::fabs(least[i]), most[i] + kSlack * std::fabs(most[i]));
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
        for (size_t c = 0; c < 3; ++c)
          keepTile((*images[k])[c], {(*values[k])[c], noisy[c], variance[c]}, radius, tile);
    });
  });
}

}  // namespace braid
