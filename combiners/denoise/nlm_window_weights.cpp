// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/nlm_window_weights.h"

#include <algorithm>

namespace braid {

namespace {

constexpr int kTileWidth = 128, kTileHeight = 32;
constexpr float kOne = 65535.0f;  // what a weight of 1 is stored as

// Adds w and w in, and the same for w⁴, to the sums of one row of a tile.
void addWeighted(const float* __restrict w, int count, float* __restrict total, float* __restrict totalFourth) {
  for (int x = 0; x < count; ++x) {
    const float square = w[x] * w[x];
    total[x] += w[x];
    totalFourth[x] += square * square;
  }
}
void addWeighted(const float* __restrict w, const float* __restrict in, int count, float* __restrict sum,
                 float* __restrict sumFourth) {
  for (int x = 0; x < count; ++x) {
    const float square = w[x] * w[x];
    sum[x] += w[x] * in[x];
    sumFourth[x] += square * square * in[x];
  }
}

// The weighted means of an image in one tile, at both sensitivities.
class TileMeans {
 public:
  TileMeans(const PixelRect& tile, const Rgb<float>& image)
      : tile_(tile),
        image_(image),
        area_(static_cast<size_t>(tile.width()) * static_cast<size_t>(tile.height())),
        sums_(8 * area_, 0.0f) {}

  void add(const float* weights, int dx, int dy) {
    const PixelRect inside = intersection(tile_, pairsAt(dx, dy, image_.width(), image_.height()));
    for (int y = inside.y0; y < inside.y1; ++y) {
      const size_t at = static_cast<size_t>(y - tile_.y0) * static_cast<size_t>(tile_.width()) +
                        static_cast<size_t>(inside.x0 - tile_.x0);
      runVectorised([&] {
        for (size_t c = 0; c < 3; ++c)
          addWeighted(weights + at, &image_[c].at(inside.x0 + dx, y + dy), inside.width(), sum(c) + at,
                      sum(4 + c) + at);
        addWeighted(weights + at, inside.width(), sum(3) + at, sum(7) + at);
      });
    }
  }

  void finish(std::array<Rgb<float>, 2>& out) {
    for (size_t k = 0; k < 2; ++k)
      for (size_t c = 0; c < 3; ++c)
        for (int y = tile_.y0; y < tile_.y1; ++y) {
          const size_t at = static_cast<size_t>(y - tile_.y0) * static_cast<size_t>(tile_.width());
          float* to = &out[k][c].at(tile_.x0, y);
          for (size_t x = 0; x < static_cast<size_t>(tile_.width()); ++x)
            to[x] = sum(4 * k + c)[at + x] / sum(4 * k + 3)[at + x];
        }
  }

 private:
  float* sum(size_t quantity) { return sums_.data() + quantity * area_; }

  PixelRect tile_;
  const Rgb<float>& image_;
  size_t area_;
  std::vector<float> sums_;
};

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
  if (zeroOrder) *zeroOrder = {Rgb<float>(width_, height_), Rgb<float>(width_, height_)};
  forEachTile(width_, height_, kTileWidth, kTileHeight,
              [&](const PixelRect& tile) { fillTile(guides, tile, image, zeroOrder); });
}

void NlmWindowStore::fillTile(std::span<const NlmGuide> guides, const PixelRect& tile, const Rgb<float>* image,
                              std::array<Rgb<float>, 2>* zeroOrder) {
  NlmWeights weights(guides, tile);
  std::vector<TileMeans> means;
  if (zeroOrder) means.emplace_back(tile, *image);
  for (int dy = -radius_; dy <= radius_; ++dy)
    for (int dx = -radius_; dx <= radius_; ++dx) {
      if (intersection(tile, pairsAt(dx, dy, width_, height_)).empty()) continue;
      const float* w = weights.at(dx, dy);
      storeOffset(w, dx, dy, tile);
      if (zeroOrder) means[0].add(w, dx, dy);
    }
  if (zeroOrder) means[0].finish(*zeroOrder);
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

void NlmWindowStore::row(int cx, int cy, int y, int x0, int x1, bool halfSensitivity, float* out) const {
  const uint16_t* __restrict in = data_.get() + offset(cx / stride_, cy / stride_) +
                                  static_cast<size_t>((y - cy + radius_) * side_ + x0 - cx + radius_);
  // Whole vectors: what lies past the end is the next row's, or the slack of the store.
  const int count = (x1 - x0 + WindowWeights::kRowSlack - 1) / WindowWeights::kRowSlack * WindowWeights::kRowSlack;
  float* __restrict to = out;
  for (int x = 0; x < count; ++x) to[x] = static_cast<float>(in[x]) * (1 / kOne);
  if (!halfSensitivity) return;
  for (int x = 0; x < count; ++x) to[x] *= to[x];
  for (int x = 0; x < count; ++x) to[x] *= to[x];
}

}  // namespace braid
