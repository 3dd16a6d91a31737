// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/nlm/nlm_window_weights.h"

#include <algorithm>
#include <optional>

namespace braid {

namespace {

constexpr int kTileWidth = 128, kTileHeight = 32;
constexpr float kOne = 65535.0f;  // what a weight of 1 is stored as

// Whole vectors: what lies past the end is the next row's, or the slack of the store.
int wholeVectors(int count) {
  return (count + WindowWeights::kRowSlack - 1) / WindowWeights::kRowSlack * WindowWeights::kRowSlack;
}

}  // namespace

NlmWindowStore::NlmWindowStore(std::span<const NlmGuide> guides, int radius, int stride, const Rgb<float>* image,
                               std::array<Rgb<float>, 2>* zeroOrder)
    : width_(guides[0].mean[0]->width),
      height_(guides[0].mean[0]->height),
      radius_(radius),
      side_(2 * radius + 1),
      stride_(stride),
      columns_(centreCount(width_, stride)),
      rows_(centreCount(height_, stride)),
      data_(std::make_unique_for_overwrite<uint16_t[]>(offset(0, rows_) + WindowWeights::kRowSlack)) {
  forEachTile(width_, height_, kTileWidth, kTileHeight,
              [&](const PixelRect& tile) { fillTile(guides, tile, image, zeroOrder); });
}

void NlmWindowStore::fillTile(std::span<const NlmGuide> guides, const PixelRect& tile, const Rgb<float>* image,
                              std::array<Rgb<float>, 2>* zeroOrder) {
  NlmWeights weights(guides, radius_, tile);
  std::optional<TileSums> sums;
  if (zeroOrder) {
    const std::array<const Plane<float>*, 3> in = {&(*image)[0], &(*image)[1], &(*image)[2]};
    sums.emplace(tile, radius_, in, !(*zeroOrder)[1].empty());
  }
  for (int dy = -radius_; dy <= radius_; ++dy)
    for (int dx = -radius_; dx <= radius_; ++dx) {
      if (intersection(tile, pairsAt(dx, dy, width_, height_)).empty()) continue;
      const float* w = weights.at(dx, dy);
      storeOffset(w, dx, dy, tile);
      if (sums) sums->add(w, dx, dy);
    }
  if (!sums) return;
  sums->finish();
  for (size_t k = 0; k < 2; ++k)
    if (!(*zeroOrder)[k].empty())
      for (size_t c = 0; c < 3; ++c) sums->mean(c, k == 1, (*zeroOrder)[k][c]);
}

void NlmWindowStore::storeOffset(const float* weights, int dx, int dy, const PixelRect& tile) {
  const size_t entry = static_cast<size_t>((dy + radius_) * side_ + dx + radius_);
  // The last centre of an axis may be nearer to its neighbour than the stride, hence the search by position.
  const auto firstAt = [this](int pixel, int size) {
    int k = std::max(0, pixel / stride_ - 1);
    while (k < centreCount(size, stride_) && centrePosition(k, size, stride_) < pixel) ++k;
    return k;
  };
  const int firstColumn = firstAt(tile.x0, width_), endColumn = firstAt(tile.x1, width_);
  for (int r = firstAt(tile.y0, height_), endRow = firstAt(tile.y1, height_); r < endRow; ++r) {
    const float* in = weights + static_cast<ptrdiff_t>(centrePosition(r, height_, stride_) - tile.y0) * tile.width();
    uint16_t* out = data_.get() + offset(firstColumn, r) + entry;
    for (int k = firstColumn; k < endColumn; ++k, out += side_ * side_)
      *out = static_cast<uint16_t>(in[centrePosition(k, width_, stride_) - tile.x0] * kOne + 0.5f);
  }
}

void NlmWindowStore::row(int cx, int cy, int y, int x0, int x1, float* out) const {
  const uint16_t* __restrict in = data_.get() + offset(cx / stride_, cy / stride_) +
                                  static_cast<size_t>((y - cy + radius_) * side_ + x0 - cx + radius_);
  const int count = wholeVectors(x1 - x0);
  float* __restrict to = out;
  for (int x = 0; x < count; ++x) to[x] = static_cast<float>(in[x]) * (1 / kOne);
}

void NlmWindowStore::halveSensitivity(int x0, int x1, float* out) {
  const int count = wholeVectors(x1 - x0);
  float* __restrict to = out;
  for (int x = 0; x < count; ++x) to[x] *= to[x];
  for (int x = 0; x < count; ++x) to[x] *= to[x];
}

}  // namespace braid
