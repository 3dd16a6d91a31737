// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble/ensemble_weights.h"

#include <algorithm>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/channel_mean.h"
#include "combiners/pixels/window.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/ensemble/simplex_solver.h"
#include "renderer/core/error.h"
#include "renderer/core/window_sums.h"

namespace braid {

namespace {

constexpr int kTileWidth = 128, kTileHeight = 32;

// Row `y` of a plane from column x on.
const float* rowOf(const Plane<float>& p, int x, int y) { return p.data.data() + p.index(x, y); }

void addWeighted(const float* __restrict weight, const float* __restrict image, std::vector<double>& sum) {
  double* __restrict out = sum.data();
  for (size_t i = 0; i < sum.size(); ++i) out[i] += static_cast<double>(weight[i]) * static_cast<double>(image[i]);
}

// Solves the pixels of one tile.
class TileWeights {
 public:
  TileWeights(const Estimate& x, const std::vector<const Estimate*>& bases, const EnsembleChoices& choices,
              const Plane<float>& noise)
      : x_(x),
        bases_(bases),
        choices_(choices),
        pairs_(bases.size() * (bases.size() + 1) / 2),
        terms_(choices.fullError ? 3 : 2),
        noise_(noise) {}
  void solve(const PixelRect& tile, WeightMaps& out);

 private:
  void startSums(const PixelRect& tile);
  void errorsOfRow(size_t c, int y, double* out);
  void addChannels(size_t first, size_t last);
  void addProducts(size_t i, size_t j, size_t channels);
  void sumAlongRows();
  void writeWeights(size_t c, WeightMaps& out);
  void fillMatrices(SimplexSolver& solver, int row, int column, int lanes);
  void fillBlock(int column, int row, float weight, Plane<float>& out) const;

  const Estimate& x_;
  const std::vector<const Estimate*>& bases_;
  const EnsembleChoices& choices_;
  size_t pairs_, terms_;
  const Plane<float>& noise_;  // what is added to the diagonal of M, by channel; empty: nothing
  // Row `row` of the sums of a pair: those of the rows 0, stride, 2 stride, … of the tile.
  double* sumsOfRow(size_t pair, int row) {
    return sums_.data() + (pair * static_cast<size_t>(rows_) + static_cast<size_t>(row)) * products_.size();
  }

  PixelRect tile_, samples_;    // the pixels solved, and those in their patches
  int rows_ = 0, columns_ = 0;  // of the blocks that share their weights
  // Of a row, by channel, base, term and column. The terms are e^A, e^B and, where asked for, (y^A - y^B) / sqrt(2).
  std::vector<double> errors_;
  std::vector<double> products_;     // of one row and pair, from the leftmost column of any patch on
  std::vector<double> row_, spare_;  // of sums
  std::vector<double> sums_;         // M by pair, row of blocks and column of pixels
};

void TileWeights::startSums(const PixelRect& tile) {
  tile_ = tile;
  samples_ = intersection(grown(tile, choices_.patchRadius), {0, 0, x_.mean.width(), x_.mean.height()});
  errors_.resize((choices_.shared ? 3 : 1) * bases_.size() * terms_ * static_cast<size_t>(samples_.width()));
  products_.assign(static_cast<size_t>(tile.width() + 2 * choices_.patchRadius), 0.0);
  row_.resize(products_.size());
  spare_.resize(products_.size());
  rows_ = (tile.height() + choices_.stride - 1) / choices_.stride;
  columns_ = (tile.width() + choices_.stride - 1) / choices_.stride;
}

void TileWeights::errorsOfRow(size_t c, int y, double* out) {
  const auto width = static_cast<size_t>(samples_.width());
  const float *xa = rowOf(x_.half[0][c], samples_.x0, y), *xb = rowOf(x_.half[1][c], samples_.x0, y);
  for (const Estimate* base : bases_) {
    const float *ya = rowOf(base->half[0][c], samples_.x0, y), *yb = rowOf(base->half[1][c], samples_.x0, y);
    double *ea = out, *eb = ea + width, *d = eb + width;
    for (size_t i = 0; i < width; ++i) {
      ea[i] = static_cast<double>(ya[i]) - static_cast<double>(xb[i]);
      eb[i] = static_cast<double>(yb[i]) - static_cast<double>(xa[i]);
    }
    for (size_t i = 0; i < width && choices_.fullError; ++i)
      d[i] = 0.70710678118654752 * (static_cast<double>(ya[i]) - static_cast<double>(yb[i]));
    if (choices_.rootWeights) {
      const float* root = rowOf(*choices_.rootWeights, samples_.x0, y);
      for (double* e = out; e != out + terms_ * width; e += width)
        for (size_t i = 0; i < width; ++i) e[i] *= static_cast<double>(root[i]);
    }
    out += terms_ * width;
  }
}

// The products of the errors of two bases along a row, summed over the channels; a common factor of two does not
// matter.
void TileWeights::addProducts(size_t i, size_t j, size_t channels) {
  const auto width = static_cast<size_t>(samples_.width()), ofBase = terms_ * width;
  double* __restrict out = products_.data() + (samples_.x0 - (tile_.x0 - choices_.patchRadius));
  std::fill_n(out, width, 0.0);
  for (size_t c = 0; c < channels; ++c) {
    const double* __restrict p = errors_.data() + (c * bases_.size() + i) * ofBase;
    const double* __restrict q = errors_.data() + (c * bases_.size() + j) * ofBase;
    for (size_t k = 0; k < width; ++k) out[k] += p[k] * q[k] + p[width + k] * q[width + k];
    for (size_t k = 0; k < width && choices_.fullError; ++k) out[k] -= p[2 * width + k] * q[2 * width + k];
  }
}

// Adds the products of the channels [first, last) to the sums of all rows of blocks whose patches hold them.
void TileWeights::addChannels(size_t first, size_t last) {
  const int radius = choices_.patchRadius, stride = choices_.stride, count = static_cast<int>(products_.size());
  const size_t ofChannel = bases_.size() * terms_ * static_cast<size_t>(samples_.width());
  for (int y = samples_.y0; y < samples_.y1; ++y) {
    for (size_t c = first; c < last; ++c) errorsOfRow(c, y, errors_.data() + (c - first) * ofChannel);
    const int from = (std::max(tile_.y0, y - radius) - tile_.y0 + stride - 1) / stride;
    size_t pair = 0;
    for (size_t i = 0; i < bases_.size(); ++i)
      for (size_t j = 0; j <= i; ++j, ++pair) {
        addProducts(i, j, last - first);
        for (int row = from; tile_.y0 + row * stride < std::min(tile_.y1, y + radius + 1); ++row)
          addValues(products_.data(), count, sumsOfRow(pair, row));
      }
  }
}

void TileWeights::sumAlongRows() {
  const int window = 2 * choices_.patchRadius + 1;
  for (size_t pair = 0; pair < pairs_; ++pair)
    for (int row = 0; row < rows_; ++row) {
      double* sums = sumsOfRow(pair, row);
      std::copy_n(sums, products_.size(), row_.data());
      windowSums(row_.data(), spare_.data(), tile_.width(), window, sums);
    }
}

// Solves for all blocks of the tile; the weights are those of channel c, or of all.
void TileWeights::writeWeights(size_t c, WeightMaps& out) {
  SimplexSolver solver(bases_.size(), choices_.nonNegative, choices_.improvement);
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; column += SimplexSolver::kLanes) {
      const int lanes = std::min(SimplexSolver::kLanes, columns_ - column);
      fillMatrices(solver, row, column, lanes);
      solver.solve();
      for (size_t b = 0; b < bases_.size(); ++b)
        for (int l = 0; l < lanes; ++l)
          fillBlock(column + l, row, static_cast<float>(solver.weight(b)[l]), out.of(b, c));
    }
}

// M of the blocks from (column, row) on.
void TileWeights::fillMatrices(SimplexSolver& solver, int row, int column, int lanes) {
  const int stride = choices_.stride;
  const double channels = choices_.shared ? 3 : 1;
  const float* noise = noise_.size() > 0 ? rowOf(noise_, tile_.x0, tile_.y0 + row * stride) : nullptr;
  size_t pair = 0;
  for (size_t i = 0; i < bases_.size(); ++i)
    for (size_t j = 0; j <= i; ++j, ++pair) {
      double* to = solver.entry(i, j);
      const double* sums = sumsOfRow(pair, row);
      std::fill_n(to, SimplexSolver::kLanes, 0.0);
      for (int l = 0; l < lanes; ++l) to[l] = sums[(column + l) * stride];
      if (i != j || !noise) continue;
      for (int l = 0; l < lanes; ++l) to[l] += channels * static_cast<double>(noise[(column + l) * stride]);
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
    sums_.assign(pairs_ * static_cast<size_t>(rows_) * products_.size(), 0.0);
    runVectorised([&] {
      addChannels(c, c + together);
      sumAlongRows();
    });
    writeWeights(c, out);
  }
}

// The prior times the mean variance of a half of x over every patch, averaged over channels.
Plane<float> patchNoise(const Estimate& x, const EnsembleChoices& choices) {
  if (choices.prior <= 0) return {};
  const Rgb<float> variance = meanVariance(x);
  const Plane<float> ofHalf = channelMean(variance, [&](size_t i, size_t c) {
    const double root = choices.rootWeights ? static_cast<double>((*choices.rootWeights)[i]) : 1.0;
    return 2 * choices.prior * root * root * static_cast<double>(variance[c][i]);
  });
  return boxMean<float>(ofHalf, choices.patchRadius);
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
  const Plane<float> noise = patchNoise(unbiased, choices);
  WeightMaps out = uniformWeights(bases.size(), choices.shared ? 1 : 3, width, height);
  forEachTile(width, height, kTileWidth, kTileHeight,
              [&](const PixelRect& tile) { TileWeights(unbiased, bases, choices, noise).solve(tile, out); });
  return out;
}

Rgb<float> weightedImage(const WeightMaps& weights, const std::vector<const Rgb<float>*>& images) {
  Rgb<float> out(images[0]->width(), images[0]->height(), kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    std::vector<double> sum(end - begin);
    runVectorised([&] {
      for (size_t c = 0; c < 3; ++c) {
        std::fill(sum.begin(), sum.end(), 0.0);
        for (size_t b = 0; b < images.size(); ++b) addWeighted(&weights.of(b, c)[begin], &(*images[b])[c][begin], sum);
        for (size_t i = begin; i < end; ++i) out[c][i] = finiteFloat(sum[i - begin]);
      }
    });
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
