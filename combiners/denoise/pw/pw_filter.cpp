// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/pw/pw_filter.h"

#include <cmath>

#include "combiners/denoise/pw/pw_rows.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

// The buffers of rows begin so many pixels left of the tile: all that a pair of it may reach.
constexpr int kLead = kRowUnit;
static_assert(kLead > PatchWelchNeighbours::kMostRadius);

// The filter in one tile. The weight of a pair is the same seen from either pixel, hence only one of d and -d is
// visited: each weight adds q to the sums of p and p to those of q. Pairs that reach into the tile from outside are
// computed in the tiles of both pixels, with the same bits.
class TileFilter {
 public:
  TileFilter(const PatchWelchInput& input, const std::vector<float>& squaredThresholds,
             const PatchWelchNeighbours& neighbours, const PixelRect& tile, PatchWelchWeights* kept)
      : target_(tile),
        width_(input.width()),
        height_(input.height()),
        thresholds_(squaredThresholds),
        neighbours_(neighbours),
        reach_(neighbours.radius),
        tile_(input, intersection(grown(tile, reach_ + 1), {0, 0, width_, height_}), tile.x0),
        images_(input.images.size()),
        kept_(kept),
        columns_(static_cast<size_t>(2 * reach_ + 1)) {
    const PixelBuffer<float> zeros(static_cast<size_t>(kLead + wholeVectors(target_.width()) + 2 * kRowUnit), 0.0f);
    for (Column& column : columns_) {
      for (auto& image : column.patchRows) image.fill(zeros);
      column.inverseCount = column.weight = column.edge = zeros;
    }
    differences_.fill(PixelBuffer<float>(zeros.size() + kRowUnit, 0.0f));
    ofFirst_.reserve(columns_.size());
    ofSecond_.reserve(columns_.size());
    startAtCentre();
  }

  // Row by row for all dx of a dy, so that the rows that they share stay in the cache.
  void run() {
    for (int dy = 0; dy <= reach_; ++dy) {
      const int y0 = std::max(target_.y0 - dy, 0), y1 = std::min(target_.y1, height_ - dy);
      if (y0 >= y1) continue;
      for (int dx = -reach_; dx <= reach_; ++dx) begin(dx, dy);
      for (int y = y0 - 1; y <= y1; ++y) {
        for (int dx = -reach_; dx <= reach_; ++dx)
          if (!columnOf(dx).p.empty()) patchRow(columnOf(dx), y, dx, dy);
        if (y > y0) accumulate(y - 1, dy);
      }
    }
  }

  // The weighted means, with the albedo back in place.
  void write(std::vector<std::vector<Rgb<float>>>& out) const {
    for (size_t k = 0; k < thresholds_.size(); ++k)
      for (size_t i = 0; i < images_; ++i)
        for (size_t c = 0; c < 3; ++c)
          for (int y = target_.y0; y < target_.y1; ++y) {
            const WeightedSums& sums = sums_[k * images_ + i];
            const float* __restrict sum = sums.plane[1 + c].data() + sumIndex(target_.x0, y);
            const float* __restrict total = sums.plane[0].data() + sumIndex(target_.x0, y);
            const float* __restrict a = tile_.divisor[c].data() + tile_.index(target_.x0, y);
            float* __restrict to = &out[k][i][c].at(target_.x0, y);
            for (int x = 0; x < target_.width(); ++x) to[x] = a[x] * (sum[x] / total[x]);
          }
  }

 private:
  // Rows of sums are whole vectors.
  ptrdiff_t sumIndex(int x, int y) const {
    return static_cast<ptrdiff_t>(y - target_.y0) * wholeVectors(target_.width()) + (x - target_.x0);
  }

  // The weight of a pixel with itself is 1.
  void startAtCentre() {
    const auto area = static_cast<size_t>(wholeVectors(target_.width())) * static_cast<size_t>(target_.height());
    sums_.resize(thresholds_.size() * images_);
    for (size_t k = 0; k < sums_.size(); ++k) {
      sums_[k].plane[0] = PixelBuffer<float>(area, 1.0f);
      for (size_t c = 0; c < 3; ++c) {
        sums_[k].plane[1 + c] = PixelBuffer<float>(area, 0.0f);
        const PixelBuffer<float>& u = tile_.radiance[k % images_][c];
        for (int y = target_.y0; y < target_.y1; ++y)
          std::copy_n(u.data() + tile_.index(target_.x0, y), target_.width(),
                      sums_[k].plane[1 + c].data() + sumIndex(target_.x0, y));
      }
    }
  }

  // What is kept of an offset while the rows go by.
  struct Column {
    PixelRect p, pairs;      // the pixels p of pairs (p, p + d) with a pixel in the tile, and of those in the image
    int begin = 0, end = 0;  // p's columns in the buffers of rows, as whole vectors
    float spatial = 0;
    std::array<std::array<PixelBuffer<float>, 3>, PatchWelchInput::kMaxImages> patchRows;  // the last three
    PixelBuffer<float> inverseCount;
    PixelBuffer<float> weight, edge;  // of the row and image at hand; weights are zero outside of p
    bool edgeReady = false;
    float* patchRow(size_t image, int y) { return patchRows[image][static_cast<size_t>(y + 3) % 3].data() + begin; }
  };
  Column& columnOf(int dx) { return columns_[static_cast<size_t>(dx + reach_)]; }

  // Where the pixels of column x are in the buffers of rows.
  int position(int x) const { return x - target_.x0 + kLead; }
  // The pixel at such a position.
  ptrdiff_t tileIndex(int at, int y) const { return tile_.index(target_.x0 - kLead + at, y); }

  // dy >= 0; of d and -d one only.
  void begin(int dx, int dy) {
    Column& column = columnOf(dx);
    column.p = {};
    if (!neighbours_.contain(dx, dy) || (dy == 0 && dx <= 0)) return;
    const PixelRect reach = {target_.x0 - std::max(dx, 0), target_.y0 - dy, target_.x1 + std::max(-dx, 0), target_.y1};
    column.pairs = pairsAt(dx, dy, width_, height_);
    column.p = intersection(reach, column.pairs);
    if (column.p.empty()) return;
    column.begin = position(column.p.x0) / kRowUnit * kRowUnit;
    column.end = wholeVectors(position(column.p.x1));
    std::fill(column.weight.begin(), column.weight.end(), 0.0f);
    for (int x = column.p.x0; x < column.p.x1; ++x)
      column.inverseCount[static_cast<size_t>(position(x))] =
          1.0f / static_cast<float>(3 * patchCount(x, 1, column.pairs.x0, column.pairs.x1));
    const double distance2 = dx * dx + dy * dy;
    column.spatial = static_cast<float>(-static_cast<double>(kLog2E) * distance2 /
                                        (2 * kPatchWelchSpatialSd * kPatchWelchSpatialSd));
  }

  // A row of z²; the sums over three read the value before the first, too.
  float* differencesOf(size_t image) { return differences_[image].data() + kRowUnit; }

  // Row y of z², summed over three neighbours in x, of every image; zeros outside the image.
  void patchRow(Column& column, int y, int dx, int dy) {
    const PixelRect &p = column.p, &pairs = column.pairs;
    const int count = column.end - column.begin;
    if (y < pairs.y0 || y >= pairs.y1) {
      for (size_t i = 0; i < images_; ++i) std::fill_n(column.patchRow(i, y), count, 0.0f);
      return;
    }
    const int x0 = position(std::max(p.x0 - 1, pairs.x0)), x1 = position(std::min(p.x1 + 1, pairs.x1));
    const int first = x0 / kRowUnit * kRowUnit, last = wholeVectors(x1);
    const ptrdiff_t at = tileIndex(first, y), to = tileIndex(first + dx, y + dy);
    std::array<float*, PatchWelchInput::kMaxImages> rows{};
    for (size_t i = 0; i < images_; ++i) rows[i] = differencesOf(i) + first;
    images_ == 3 ? differenceRows<3>(tile_, at, to, last - first, rows.data())
                 : differenceRows<1>(tile_, at, to, last - first, rows.data());
    for (size_t i = 0; i < images_; ++i) {
      float* z2 = differencesOf(i);
      std::fill(z2 + first - 1, z2 + x0, 0.0f);
      std::fill(z2 + x1, z2 + last + 1, 0.0f);
      boxRow(z2 + column.begin, count, column.patchRow(i, y));
    }
  }

  // Adds the pairs of row y at all dx to the sums of both pixels.
  void accumulate(int y, int dy) {
    for (Column& column : columns_) column.edgeReady = false;
    for (size_t i = 0; i < images_; ++i)
      for (size_t k = 0; k < thresholds_.size(); ++k) {
        ofFirst_.clear();
        ofSecond_.clear();
        for (int dx = -reach_; dx <= reach_; ++dx)
          if (!columnOf(dx).p.empty() && weigh(columnOf(dx), y, dx, dy, i, thresholds_[k])) {
            listRows(columnOf(dx), y, dx, dy, tile_.radiance[i]);
            if (kept_) keepWeights(columnOf(dx), y, dx, dy, i);
          }
        WeightedSums& sums = sums_[k * images_ + i];
        const int count = wholeVectors(target_.width());
        if (y >= target_.y0) addRows(ofFirst_, count, sums, sumIndex(target_.x0, y));
        if (y + dy < target_.y1) addRows(ofSecond_, count, sums, sumIndex(target_.x0, y + dy));
      }
  }

  // Row y of the weights of an image; whether any is positive.
  bool weigh(Column& column, int y, int dx, int dy, size_t image, float squaredThreshold) {
    const PixelRect& pairs = column.pairs;
    const int begin = column.begin, count = column.end - begin;
    const float inverseRows = 1.0f / static_cast<float>(patchCount(y, 1, pairs.y0, pairs.y1));
    const float scale = inverseRows / (squaredThreshold * PatchWelchInput::varianceFactor(image));
    float *weight = column.weight.data() + begin, *edge = column.edge.data() + begin;
    if (!toleranceRow({column.patchRow(image, y - 1), column.patchRow(image, y), column.patchRow(image, y + 1)},
                      column.inverseCount.data() + begin, scale, count, weight))
      return false;
    if (!column.edgeReady)
      edgeRow(tile_, tileIndex(begin, y), tileIndex(begin + dx, y + dy), column.spatial, count, edge);
    column.edgeReady = true;
    weightRow(weight, edge, count);
    std::fill(weight, weight + (position(column.p.x0) - begin), 0.0f);
    std::fill(weight + (position(column.p.x1) - begin), weight + count, 0.0f);
    return true;
  }

  // The weights of a dx add q to the sums of p, and p to those of q.
  void listRows(const Column& column, int y, int dx, int dy, const PatchWelchTile::Plane3& u) {
    const float* weight = column.weight.data() + kLead;
    ofFirst_.push_back({weight, rowsAt(u, tile_.index(target_.x0 + dx, y + dy))});
    ofSecond_.push_back({weight - dx, rowsAt(u, tile_.index(target_.x0 - dx, y))});
  }

  // The weights of pairs of row y of which a pixel is to keep them.
  void keepWeights(const Column& column, int y, int dx, int dy, size_t image) {
    const int stride = kept_->stride(), x0 = roundUp(target_.x0, stride);
    const float* weight = column.weight.data() + kLead - target_.x0;
    const auto keep = [&](int row, size_t k, const float* ofColumn) {
      if (row < target_.y0 || row >= target_.y1 || row % stride != 0) return;
      for (int x = x0; x < target_.x1; x += stride)
        kept_->of(x, row, image)[k] = PatchWelchWeights::packed(ofColumn[x]);
    };
    keep(y, kept_->order(dx, dy), weight);
    keep(y + dy, kept_->order(-dx, -dy), weight - dx);
  }

  PixelRect target_;
  int width_, height_;  // of the image
  const std::vector<float>& thresholds_;
  PatchWelchNeighbours neighbours_;
  int reach_;  // the largest distance in x and in y of a neighbour
  PatchWelchTile tile_;
  size_t images_;
  PatchWelchWeights* kept_;         // or null
  std::vector<WeightedSums> sums_;  // [threshold][image]
  std::vector<Column> columns_;     // by dx
  // Buffers of rows; see position().
  std::array<PixelBuffer<float>, PatchWelchInput::kMaxImages> differences_;
  std::vector<WeightedRow> ofFirst_, ofSecond_;  // what is added to the sums of p, and of q
};

// Images of the size of `input`, one for each of its images, whose pixels are still to be written.
std::vector<Rgb<float>> unfilledImages(const PatchWelchInput& input) {
  std::vector<Rgb<float>> images;
  for (size_t i = 0; i < input.images.size(); ++i) images.emplace_back(input.width(), input.height(), kUnfilled);
  return images;
}

// The pixels of a cancelled tile.
void blacken(const PixelRect& tile, std::vector<Rgb<float>>& images) {
  for (Rgb<float>& image : images)
    for (Plane<float>& plane : image.channel)
      for (int y = tile.y0; y < tile.y1; ++y) std::fill_n(&plane.at(tile.x0, y), tile.width(), 0.0f);
}

}  // namespace

double studentQuantile(double z, uint64_t dof) {
  const auto v = static_cast<double>(dof);
  // Cornish-Fisher expansion, better than 10⁻⁵ here.
  if (dof > 60 || dof % 2 == 1) {
    const double z2 = z * z, z3 = z2 * z, z5 = z3 * z2, z7 = z5 * z2;
    return z + (z3 + z) / (4 * v) + (5 * z5 + 16 * z3 + 3 * z) / (96 * v * v) +
           (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / (384 * v * v * v);
  }
  // With u = t / sqrt(v + t²), P(T <= t) - 1/2 = u / 2 Σ_j c_j (1 - u²)^j for j < v / 2, c_j = c_{j-1} (2j - 1) / (2j)
  // (Abramowitz & Stegun 26.7.4). It grows with u: bisection.
  const double target = std::erf(z / std::sqrt(2.0));
  double low = 0, high = 1;
  for (int step = 0; step < 60; ++step) {
    const double u = 0.5 * (low + high);
    double term = 1, sum = 1;
    for (uint64_t j = 1; j < dof / 2; ++j) {
      term *= (1 - u * u) * static_cast<double>(2 * j - 1) / static_cast<double>(2 * j);
      sum += term;
    }
    (u * sum < target ? low : high) = u;
  }
  return low * std::sqrt(v / (1 - low * low));
}

float squaredThreshold(double z, uint64_t passes) {
  BRAID_ASSERT(passes >= 2);
  const double t = studentQuantile(z, 2 * passes - 2);
  return static_cast<float>(t * t);
}

std::vector<std::vector<Rgb<float>>> patchWelch(const PatchWelchInput& input, std::span<const double> thresholds,
                                                const PatchWelchNeighbours& neighbours, TileSize tiles,
                                                const std::atomic<bool>* cancel, PatchWelchWeights* kept) {
  BRAID_ASSERT(!thresholds.empty() && (input.images.size() == 1 || input.images.size() == 3));
  BRAID_ASSERT(!kept || thresholds.size() == 1);
  BRAID_ASSERT(neighbours.radius >= 0 && neighbours.radius <= PatchWelchNeighbours::kMostRadius);
  const int width = input.width(), height = input.height();
  std::vector<std::vector<Rgb<float>>> out(thresholds.size());
  for (std::vector<Rgb<float>>& images : out) images = unfilledImages(input);
  std::vector<float> squared;
  for (const double z : thresholds) squared.push_back(squaredThreshold(z, input.passes));
  forEachTile(width, height, tiles.width, tiles.height, [&](const PixelRect& tile) {
    if (cancel && cancel->load(std::memory_order_relaxed)) {
      for (std::vector<Rgb<float>>& images : out) blacken(tile, images);
      return;
    }
    TileFilter filter(input, squared, neighbours, tile, kept);
    runVectorised([&] { filter.run(); });
    filter.write(out);
  });
  return out;
}

}  // namespace braid
