// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/rdfc/rdfc_window.h"

#include "renderer/core/error.h"

namespace braid {

namespace {

using namespace rdfc;

constexpr int kPatch = 3, kSmoothing = 2;
constexpr float kPatchPixels = (2 * kPatch + 1) * (2 * kPatch + 1);
constexpr float kInverseSmoothing = 1.0f / ((2 * kSmoothing + 1) * (2 * kSmoothing + 1));

// Rows of a tile grown by a margin.
class Block {
 public:
  Block(const PixelRect& tile, int margin)
      : y0_(tile.y0 - margin),
        pitch_(rdfcRowCount(tile.width() + 2 * (kPatch + kSmoothing)) + kRdfcRowUnit),
        data_(static_cast<size_t>(pitch_) * static_cast<size_t>(tile.height() + 2 * margin)) {}
  float* row(int y) { return data_.data() + static_cast<ptrdiff_t>(y - y0_) * pitch_; }
  ptrdiff_t pitch() const { return pitch_; }

 private:
  int y0_, pitch_;
  std::vector<float> data_;
};

RdfcRows rowsAt(RdfcTriple<Block>& blocks, int y) {
  return {blocks.forward.row(y), blocks.backward.row(y), blocks.both.row(y)};
}

RdfcTriple<Block> blocksOf(const PixelRect& tile, int margin) {
  return {Block(tile, margin), Block(tile, margin), Block(tile, margin)};
}

PixelRect oneRow(const PixelRect& tile) { return {tile.x0, tile.y0, tile.x1, tile.y0 + 1}; }

// The filter in one tile. Rows of distances begin at tile.x0 - 5, those of weights at tile.x0 - 2.
class WindowTile {
 public:
  WindowTile(const RdfcWindowFilter& filter, std::span<const MirroredPlane> in, const PixelRect& tile)
      : filter_(filter),
        in_(in),
        tile_(tile),
        scale_(1.0f / (kPatchPixels * static_cast<float>(filter.guide->size()))),
        differences_(blocksOf(oneRow(tile), 0)),
        sums_(blocksOf(tile, kPatch + kSmoothing)),
        distances_(blocksOf(tile, kSmoothing)),
        weights_(blocksOf(tile, kSmoothing)),
        smoothed_(blocksOf(oneRow(tile), 0)),
        featureWeight_(static_cast<size_t>(width())),
        total_(tile, 0),
        most_(tile, 0),
        targets_(in.size(), Block(tile, 0)) {
    for (int y = tile.y0; y < tile.y1; ++y) std::fill_n(most_.row(y), width(), kLeastOwnWeight);
  }

  void addOffset(int dx, int dy) {
    for (int y = tile_.y0 - kPatch - kSmoothing; y < tile_.y1 + kPatch + kSmoothing; ++y) addDistanceRow(dx, dy, y);
    for (int y = tile_.y0 - kSmoothing; y < tile_.y1 + kSmoothing; ++y) addWeightRow(y);
    for (int y = tile_.y0; y < tile_.y1; ++y) addTargetRow(dx, dy, y);
  }

  void store(std::vector<Plane<float>>& out) {
    for (int y = tile_.y0; y < tile_.y1; ++y)
      for (size_t t = 0; t < in_.size(); ++t) {
        const float *sum = targets_[t].row(y), *most = most_.row(y), *total = total_.row(y);
        const float* own = in_[t].at(tile_.x0, y);
        float* to = &out[t].at(tile_.x0, y);
        for (int x = 0; x < tile_.width(); ++x) to[x] = (sum[x] + most[x] * own[x]) / (total[x] + most[x]);
      }
  }

 private:
  int width(int margin = 0) const { return rdfcRowCount(tile_.width() + 2 * margin); }

  // Distances of pixels, summed over the width of a patch.
  void addDistanceRow(int dx, int dy, int y) {
    const int margin = kPatch + kSmoothing;
    const RdfcRows pixels = rowsAt(differences_, tile_.y0), sums = rowsAt(sums_, y);
    colourRows<false>(*filter_.guide, filter_.k, filter_.spread, {dx, dy, tile_.x0 - margin, y, width(margin)}, pixels,
                      {});
    boxRow<kPatch>(pixels.forward, width(kSmoothing), sums.forward);
    boxRow<kPatch>(pixels.backward, width(kSmoothing), sums.backward);
    boxRow<kPatch>(pixels.both, width(kSmoothing), sums.both);
  }

  // Distances of patches, their weights, and these summed over the width of the smoothing box.
  void addWeightRow(int y) {
    const RdfcRows sums = rowsAt(sums_, y - kPatch), distance = rowsAt(distances_, y), weight = rowsAt(weights_, y);
    const auto one = [&](const float* from, float* d, float* w) {
      boxColumn<kPatch>(from, sums_.forward.pitch(), width(kSmoothing), d);
      float* each = differences_.forward.row(tile_.y0);
      for (int x = 0; x < width(kSmoothing); ++x) each[x] = weightOf(scale_ * d[x]);
      boxRow<kSmoothing>(each, width(), w);
    };
    one(sums.forward, distance.forward, weight.forward);
    one(sums.backward, distance.backward, weight.backward);
    one(sums.both, distance.both, weight.both);
  }

  void addTargetRow(int dx, int dy, int y) {
    const RdfcRows weight = rowsAt(weights_, y - kSmoothing), smooth = rowsAt(smoothed_, tile_.y0);
    const ptrdiff_t pitch = weights_.forward.pitch();
    boxColumn<kSmoothing>(weight.forward, pitch, width(), smooth.forward);
    boxColumn<kSmoothing>(weight.backward, pitch, width(), smooth.backward);
    boxColumn<kSmoothing>(weight.both, pitch, width(), smooth.both);
    blendWithMean(y, smooth);
    if (filter_.features) minWithFeatures(dx, dy, y, smooth);
    addWeights(smooth.forward, smooth.backward, width(), total_.row(y), most_.row(y));
    for (size_t t = 0; t < in_.size(); ++t)
      addWeighted(smooth.forward, smooth.backward, in_[t].at(tile_.x0 + dx, y + dy), in_[t].at(tile_.x0 - dx, y - dy),
                  width(), targets_[t].row(y));
  }

  void minWithFeatures(int dx, int dy, int y, const RdfcRows& smooth) {
    featureWeight_.clear(width());
    for (const RdfcGuide& feature : *filter_.features) {
      featureRows<false>(feature, filter_.spread, {dx, dy, tile_.x0, y, width()}, featureWeight_.distance(), {});
      featureWeight_.add(1.0f / static_cast<float>(feature.size()), width());
    }
    featureWeight_.finish(width());
    minOf(featureWeight_.forward(), smooth.forward);
    minOf(featureWeight_.backward(), smooth.backward);
  }
  void minOf(const float* __restrict other, float* __restrict weight) {
    for (int x = 0; x < width(); ++x) weight[x] = smaller(weight[x], other[x]);
  }

  void blendWithMean(int y, const RdfcRows& smooth) {
    const float* __restrict df = distances_.forward.row(y) + kSmoothing;
    const float* __restrict db = distances_.backward.row(y) + kSmoothing;
    float* __restrict forward = smooth.forward, * __restrict backward = smooth.backward;
    const float* __restrict both = smooth.both;
    for (int x = 0; x < width(); ++x) {
      const float f = forward[x] * kInverseSmoothing, b = backward[x] * kInverseSmoothing;
      const float m = both[x] * kInverseSmoothing;
      const float a = shareOfMean(f, b, m, scale_ * df[x], scale_ * db[x]);
      forward[x] = f + a * (m - f);
      backward[x] = b + a * (m - b);
    }
  }

  const RdfcWindowFilter& filter_;
  std::span<const MirroredPlane> in_;
  PixelRect tile_;
  float scale_;  // of a distance summed over patch and channels
  RdfcTriple<Block> differences_, sums_, distances_, weights_, smoothed_;
  SmallestWeight featureWeight_;
  Block total_, most_;  // of the weights
  std::vector<Block> targets_;
};

}  // namespace

std::vector<Plane<float>> rdfcFiltered(const RdfcWindowFilter& filter, std::span<const MirroredPlane> in,
                                       const std::atomic<bool>* cancel) {
  BRAID_ASSERT(filter.guide && !filter.guide->empty() && filter.window >= 0 && filter.window <= 10);
  if (in.empty()) return {};
  const int width = in[0].width(), height = in[0].height();
  std::vector<Plane<float>> out(in.size(), Plane<float>(width, height));
  forEachTile(width, height, kRdfcTileWidth, kRdfcTileHeight, [&](const PixelRect& rect) {
    if (cancel && cancel->load(std::memory_order_relaxed)) return;
    WindowTile tile(filter, in, rect);
    forEachRdfcOffset(filter.window, [&](int dx, int dy) { runVectorised([&] { tile.addOffset(dx, dy); }); });
    tile.store(out);
  });
  return out;
}

}  // namespace braid
