// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble_weights.h"

#include <algorithm>

#include "combiners/denoise/window.h"
#include "combiners/finite_float.h"
#include "combiners/simplex_solver.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr int kTileWidth = 128, kTileHeight = 32;

// Row `y` of a plane from column x on.
const float* rowOf(const Plane<float>& p, int x, int y) { return p.data.data() + p.index(x, y); }

// Solves the pixels of one tile.
class TileWeights {
 public:
  TileWeights(const Estimate& x, const std::vector<const Estimate*>& bases, const EnsembleChoices& choices)
      : x_(x), bases_(bases), choices_(choices), pairs_(bases.size() * (bases.size() + 1) / 2) {}
  void solve(const PixelRect& tile, WeightMaps& out);

 private:
  void startSums(const PixelRect& tile);
  void errorsOfRow(size_t c, int y, double* out);
  void addChannels(size_t first, size_t last);
  void addPatchRow(size_t pair, const double* products, int y);
  void writeWeights(size_t c, WeightMaps& out);
  void fillBlock(int column, int row, float weight, Plane<float>& out) const;

  const Estimate& x_;
  const std::vector<const Estimate*>& bases_;
  const EnsembleChoices& choices_;
  size_t pairs_;
  // Row `row` of the sums of a pair: those of the rows 0, stride, 2 stride, … of the tile.
  double* sumsOfRow(size_t pair, int row) {
    return sums_.data() +
           (pair * static_cast<size_t>(rows_) + static_cast<size_t>(row)) * static_cast<size_t>(tile_.width());
  }

  PixelRect tile_, samples_;    // the pixels solved, and those in their patches
  int rows_ = 0, columns_ = 0;  // of the blocks that share their weights
  // Of a row, three terms a channel, base and column: e^A, e^B, (y^A - y^B) / sqrt(2).
  std::vector<double> errors_;
  std::vector<double> products_, rowSums_;  // of one row and pair
  std::vector<double> sums_;                // M by pair, row of blocks and column of pixels
};

void TileWeights::startSums(const PixelRect& tile) {
  tile_ = tile;
  samples_ = intersection(grown(tile, choices_.patchRadius), {0, 0, x_.mean.width(), x_.mean.height()});
  errors_.resize((choices_.shared ? 9 : 3) * bases_.size() * static_cast<size_t>(samples_.width()));
  products_.resize(static_cast<size_t>(samples_.width()));
  rowSums_.resize(static_cast<size_t>(tile.width()));
  rows_ = (tile.height() + choices_.stride - 1) / choices_.stride;
  columns_ = (tile.width() + choices_.stride - 1) / choices_.stride;
  sums_.assign(pairs_ * static_cast<size_t>(tile.width() * rows_), 0.0);
}

void TileWeights::errorsOfRow(size_t c, int y, double* out) {
  const auto width = static_cast<size_t>(samples_.width());
  const float *xa = rowOf(x_.half[0][c], samples_.x0, y), *xb = rowOf(x_.half[1][c], samples_.x0, y);
  for (size_t b = 0; b < bases_.size(); ++b) {
    const float *ya = rowOf(bases_[b]->half[0][c], samples_.x0, y), *yb = rowOf(bases_[b]->half[1][c], samples_.x0, y);
    double *ea = out + 3 * b * width, *eb = ea + width, *d = eb + width;
    for (size_t i = 0; i < width; ++i) {
      ea[i] = static_cast<double>(ya[i]) - static_cast<double>(xb[i]);
      eb[i] = static_cast<double>(yb[i]) - static_cast<double>(xa[i]);
      d[i] = choices_.fullError ? 0.70710678118654752 * (static_cast<double>(ya[i]) - static_cast<double>(yb[i])) : 0.0;
    }
    if (!choices_.rootWeights) continue;
    const float* root = rowOf(*choices_.rootWeights, samples_.x0, y);
    for (double* e : {ea, eb, d})
      for (size_t i = 0; i < width; ++i) e[i] *= static_cast<double>(root[i]);
  }
}

// Adds the patch sums of a row of samples to the rows of the tile whose patches hold it.
void TileWeights::addPatchRow(size_t pair, const double* products, int y) {
  const int radius = choices_.patchRadius, width = tile_.width();
  for (int x = 0; x < width; ++x) rowSums_[static_cast<size_t>(x)] = 0;
  for (int k = -radius; k <= radius; ++k) {
    const int from = std::max(tile_.x0, samples_.x0 - k), to = std::min(tile_.x1, samples_.x1 - k);
    const double* in = products + (from + k - samples_.x0);
    double* out = rowSums_.data() + (from - tile_.x0);
    for (int x = 0; x < to - from; ++x) out[x] += in[x];
  }
  const int stride = choices_.stride, first = (std::max(tile_.y0, y - radius) - tile_.y0 + stride - 1) / stride;
  for (int row = first; tile_.y0 + row * stride < std::min(tile_.y1, y + radius + 1); ++row) {
    double* out = sumsOfRow(pair, row);
    for (int x = 0; x < width; ++x) out[x] += rowSums_[static_cast<size_t>(x)];
  }
}

// Adds the errors of the channels [first, last) to the sums.
void TileWeights::addChannels(size_t first, size_t last) {
  const auto width = static_cast<size_t>(samples_.width());
  const size_t ofChannel = 3 * bases_.size() * width;
  for (int y = samples_.y0; y < samples_.y1; ++y) {
    for (size_t c = first; c < last; ++c) errorsOfRow(c, y, errors_.data() + (c - first) * ofChannel);
    size_t pair = 0;
    for (size_t i = 0; i < bases_.size(); ++i)
      for (size_t j = 0; j <= i; ++j, ++pair) {
        std::fill(products_.begin(), products_.end(), 0.0);
        for (size_t c = first; c < last; ++c) {
          const double* errors = errors_.data() + (c - first) * ofChannel;
          const double *p = errors + 3 * i * width, *q = errors + 3 * j * width;
          // Both halves and the reduction; a common factor of two does not matter.
          for (size_t k = 0; k < width; ++k)
            products_[k] += p[k] * q[k] + p[width + k] * q[width + k] - p[2 * width + k] * q[2 * width + k];
        }
        addPatchRow(pair, products_.data(), y);
      }
  }
}

// Solves for all blocks of the tile; the weights are those of channel c, or of all.
void TileWeights::writeWeights(size_t c, WeightMaps& out) {
  SimplexSolver solver(bases_.size(), choices_.nonNegative, choices_.improvement);
  const int blocks = rows_ * columns_, stride = choices_.stride;
  for (int begin = 0; begin < blocks; begin += SimplexSolver::kLanes) {
    const int lanes = std::min(SimplexSolver::kLanes, blocks - begin);
    size_t pair = 0;
    for (size_t i = 0; i < bases_.size(); ++i)
      for (size_t j = 0; j <= i; ++j, ++pair) {
        double* to = solver.entry(i, j);
        std::fill_n(to, SimplexSolver::kLanes, 0.0);
        for (int l = 0; l < lanes; ++l)
          to[l] = sumsOfRow(pair, (begin + l) / columns_)[(begin + l) % columns_ * stride];
      }
    solver.solve();
    for (size_t b = 0; b < bases_.size(); ++b)
      for (int l = 0; l < lanes; ++l)
        fillBlock((begin + l) % columns_, (begin + l) / columns_, static_cast<float>(solver.weight(b)[l]),
                  out.of(b, c));
  }
}

void TileWeights::fillBlock(int column, int row, float weight, Plane<float>& out) const {
  const int x = tile_.x0 + column * choices_.stride, y = tile_.y0 + row * choices_.stride;
  for (int v = y; v < std::min(y + choices_.stride, tile_.y1); ++v)
    for (int u = x; u < std::min(x + choices_.stride, tile_.x1); ++u) out.at(u, v) = weight;
}

void TileWeights::solve(const PixelRect& tile, WeightMaps& out) {
  startSums(tile);
  const size_t together = choices_.shared ? 3 : 1;
  for (size_t c = 0; c < 3; c += together) {
    std::fill(sums_.begin(), sums_.end(), 0.0);
    runVectorised([&] { addChannels(c, c + together); });
    writeWeights(c, out);
  }
}

}  // namespace

WeightMaps uniformWeights(size_t bases, size_t channels, int width, int height) {
  return {bases, channels,
          std::vector<Plane<float>>(bases * channels, Plane<float>(width, height, 1.0f / static_cast<float>(bases)))};
}

WeightMaps ensembleWeights(const Estimate& unbiased, const std::vector<const Estimate*>& bases,
                           const EnsembleChoices& choices) {
  BRAID_ASSERT(choices.stride >= 1 && kTileWidth % choices.stride == 0 && kTileHeight % choices.stride == 0);
  const int width = unbiased.mean.width(), height = unbiased.mean.height();
  WeightMaps out = uniformWeights(bases.size(), choices.shared ? 1 : 3, width, height);
  forEachTile(width, height, kTileWidth, kTileHeight,
              [&](const PixelRect& tile) { TileWeights(unbiased, bases, choices).solve(tile, out); });
  return out;
}

Rgb<float> weightedImage(const WeightMaps& weights, const std::vector<const Rgb<float>*>& images) {
  Rgb<float> out(images[0]->width(), images[0]->height());
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        double sum = 0;
        for (size_t b = 0; b < images.size(); ++b)
          sum += static_cast<double>(weights.of(b, c)[i]) * static_cast<double>((*images[b])[c][i]);
        out[c][i] = finiteFloat(sum);
      }
    });
  return out;
}

Estimate weightedEstimate(const WeightMaps& weights, const std::vector<const Estimate*>& bases) {
  const auto collect = [&](auto get) {
    std::vector<const Rgb<float>*> images;
    for (const Estimate* base : bases) images.push_back(get(*base));
    return weightedImage(weights, images);
  };
  Estimate out;
  out.mean = collect([](const Estimate& e) { return &e.mean; });
  for (int h = 0; h < 2; ++h) out.half[h] = collect([h](const Estimate& e) { return &e.half[h]; });
  return out;
}

std::vector<Plane<float>> channelMeans(const WeightMaps& weights) {
  std::vector<Plane<float>> out;
  for (size_t b = 0; b < weights.bases; ++b) {
    Plane<float> mean = weights.of(b, 0);
    for (size_t i = 0; i < mean.size(); ++i) mean[i] = (mean[i] + weights.of(b, 1)[i] + weights.of(b, 2)[i]) / 3;
    out.push_back(std::move(mean));
  }
  return out;
}

}  // namespace braid
