// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/pw_filter.h"

#include <cmath>
#include <cstring>

#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr int kRowUnit = 16;  // rows are computed in multiples of this; what is too much is never used
constexpr int roundUp(int n) { return (n + kRowUnit - 1) / kRowUnit * kRowUnit; }

using Rows3 = std::array<const float*, 3>;

Rows3 rowsAt(const PatchWelchTile::Plane3& planes, ptrdiff_t at) {
  return {planes[0].data() + at, planes[1].data() + at, planes[2].data() + at};
}

// out_c = 1 / (V_p + V_q + eps)
void inverseVarianceRow(const Rows3& p, const Rows3& q, int count, const std::array<float*, 3>& out) {
  for (size_t c = 0; c < 3; ++c) {
    const float* __restrict vp = p[c], * __restrict vq = q[c];
    float* __restrict r = out[c];
    for (int x = 0; x < count; ++x) r[x] = 1.0f / ((vp[x] + vq[x]) + kPatchWelchEpsilon);
  }
}

// out = the sum over the channels of (u_p - u_q)² inverse_c
void differenceRow(const Rows3& p, const Rows3& q, const Rows3& inverse, int count, float* __restrict out) {
  const float* __restrict p0 = p[0], * __restrict p1 = p[1], * __restrict p2 = p[2];
  const float* __restrict q0 = q[0], * __restrict q1 = q[1], * __restrict q2 = q[2];
  const float* __restrict r0 = inverse[0], * __restrict r1 = inverse[1], * __restrict r2 = inverse[2];
  for (int x = 0; x < count; ++x) {
    const float d0 = p0[x] - q0[x], d1 = p1[x] - q1[x], d2 = p2[x] - q2[x];
    out[x] = (d0 * d0 * r0[x] + d1 * d1 * r1[x]) + d2 * d2 * r2[x];
  }
}

void boxRow(const float* __restrict in, int count, float* __restrict out) {
  for (int x = 0; x < count; ++x) out[x] = (in[x] + in[x + 1]) + in[x + 2];
}

// out = max(0, 1 - s / t²) with s / t² = (a + b + c) inverseCount scale; whether any is positive. Not-a-number counts
// as no.
bool toleranceRow(const Rows3& rows, const float* __restrict inverseCount, float scale, int count,
                  float* __restrict out) {
  const float* __restrict a = rows[0], * __restrict b = rows[1], * __restrict c = rows[2];
  int any = 0;
  for (int x = 0; x < count; ++x) {
    const float t = 1.0f - ((a[x] + b[x]) + c[x]) * (inverseCount[x] * scale);
    out[x] = t > 0 ? t : 0.0f;
    any |= t > 0;
  }
  return any != 0;
}

// out = 2^(spatial - |guide_p - guide_q|²)
void edgeRow(const PatchWelchTile& tile, ptrdiff_t p, ptrdiff_t q, float spatial, int count, float* __restrict out) {
  const auto& g = tile.guide;
  const float* __restrict p0 = g[0].data() + p, * __restrict q0 = g[0].data() + q;
  const float* __restrict p1 = g[1].data() + p, * __restrict q1 = g[1].data() + q;
  const float* __restrict p2 = g[2].data() + p, * __restrict q2 = g[2].data() + q;
  const float* __restrict p3 = g[3].data() + p, * __restrict q3 = g[3].data() + q;
  const float* __restrict p4 = g[4].data() + p, * __restrict q4 = g[4].data() + q;
  const float* __restrict p5 = g[5].data() + p, * __restrict q5 = g[5].data() + q;
  for (int x = 0; x < count; ++x) {
    const float d0 = p0[x] - q0[x], d1 = p1[x] - q1[x], d2 = p2[x] - q2[x];
    const float d3 = p3[x] - q3[x], d4 = p4[x] - q4[x], d5 = p5[x] - q5[x];
    const float albedo = (d0 * d0 + d1 * d1) + d2 * d2, normal = (d3 * d3 + d4 * d4) + d5 * d5;
    out[x] = exp2NonPositive(spatial - (albedo + normal));
  }
}

void weightRow(float* __restrict tolerance, const float* __restrict edge, int count) {
  for (int x = 0; x < count; ++x) tolerance[x] = tolerance[x] * tolerance[x] * edge[x];
}

using Lanes = float __attribute__((vector_size(kRowUnit * sizeof(float))));

// Sums of w and of w u for the pixels of a tile, row by row.
struct Sums {
  std::array<std::vector<float>, 4> plane;  // weight, then red, green, blue
};

// A row of weights and of the pixels that they belong to.
struct WeightedRow {
  const float* w;
  Rows3 u;
};

// Adds w and w u of all rows to the sums of a row of `count` pixels, a multiple of kRowUnit.
void addRows(const std::vector<WeightedRow>& rows, int count, Sums& sums, ptrdiff_t at) {
  for (int x = 0; x < count; x += kRowUnit) {
    Lanes sum[4], w, u;
    for (size_t k = 0; k < 4; ++k) std::memcpy(&sum[k], sums.plane[k].data() + at + x, sizeof(Lanes));
    for (const WeightedRow& row : rows) {
      std::memcpy(&w, row.w + x, sizeof(w));
      sum[0] += w;
      for (size_t c = 0; c < 3; ++c) {
        std::memcpy(&u, row.u[c] + x, sizeof(u));
        sum[1 + c] += w * u;
      }
    }
    for (size_t k = 0; k < 4; ++k) std::memcpy(sums.plane[k].data() + at + x, &sum[k], sizeof(Lanes));
  }
}

// The filter in one tile. The weight of a pair is the same seen from either pixel, hence only one of d and -d is
// visited: each weight adds q to the sums of p and p to those of q. Pairs that reach into the tile from outside are
// computed in the tiles of both pixels, with the same bits.
class TileFilter {
 public:
  TileFilter(const PatchWelchInput& input, const std::vector<float>& squaredThresholds, const PixelRect& tile)
      : target_(tile),
        width_(input.width()),
        height_(input.height()),
        thresholds_(squaredThresholds),
        tile_(input, intersection(grown(tile, kPatchWelchWindow + 1), {0, 0, width_, height_})),
        images_(input.images.size()),
        row_(roundUp(tile.width() + 2 * kPatchWelchWindow) + 2 * kRowUnit) {
    const auto row = static_cast<size_t>(row_);
    for (std::vector<float>& b : inverse_) b.resize(row);
    for (Column& column : columns_) {
      for (auto& image : column.patchRows)
        for (std::vector<float>& b : image) b.resize(row);
      for (std::vector<float>* b : {&column.inverseCount, &column.weight, &column.edge}) b->resize(row);
    }
    difference_.resize(row);
    ofFirst_.reserve(columns_.size());
    ofSecond_.reserve(columns_.size());
    startAtCentre();
  }

  // Row by row for all dx of a dy, so that the rows that they share stay in the cache.
  void run() {
    for (int dy = 0; dy <= kPatchWelchWindow; ++dy) {
      const int y0 = std::max(target_.y0 - dy, 0), y1 = std::min(target_.y1, height_ - dy);
      if (y0 >= y1) continue;
      for (int dx = -kPatchWelchWindow; dx <= kPatchWelchWindow; ++dx) begin(dx, dy);
      for (int y = y0 - 1; y <= y1; ++y) {
        for (int dx = -kPatchWelchWindow; dx <= kPatchWelchWindow; ++dx)
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
            const Sums& sums = sums_[k * images_ + i];
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
    return static_cast<ptrdiff_t>(y - target_.y0) * roundUp(target_.width()) + (x - target_.x0);
  }

  // The weight of a pixel with itself is 1.
  void startAtCentre() {
    const auto area = static_cast<size_t>(roundUp(target_.width())) * static_cast<size_t>(target_.height());
    sums_.resize(thresholds_.size() * images_);
    for (size_t k = 0; k < sums_.size(); ++k) {
      sums_[k].plane[0].assign(area, 1.0f);
      for (size_t c = 0; c < 3; ++c) {
        sums_[k].plane[1 + c].resize(area);
        const std::vector<float>& u = tile_.radiance[k % images_][c];
        for (int y = target_.y0; y < target_.y1; ++y)
          std::copy_n(u.data() + tile_.index(target_.x0, y), target_.width(),
                      sums_[k].plane[1 + c].data() + sumIndex(target_.x0, y));
      }
    }
  }

  // What is kept of an offset while the rows go by.
  struct Column {
    PixelRect p, pairs;  // the pixels p of pairs (p, p + d) with a pixel in the tile, and of those in the image
    float spatial = 0;
    std::array<std::array<std::vector<float>, 3>, PatchWelchInput::kMaxImages> patchRows;  // the last three
    std::vector<float> inverseCount;
    // Of the row and image at hand, from the leftmost pixel on that a pair of the tile may have; zero where there is
    // none.
    std::vector<float> weight, edge;
    bool edgeReady = false;
    float* patchRow(size_t image, int y) { return patchRows[image][static_cast<size_t>(y + 3) % 3].data(); }
  };
  Column& columnOf(int dx) { return columns_[static_cast<size_t>(dx + kPatchWelchWindow)]; }

  // dy >= 0; of d and -d one only.
  void begin(int dx, int dy) {
    Column& column = columnOf(dx);
    column.p = {};
    if (!inPatchWelchWindow(dx, dy) || (dy == 0 && dx <= 0)) return;
    const PixelRect reach = {target_.x0 - std::max(dx, 0), target_.y0 - dy, target_.x1 + std::max(-dx, 0), target_.y1};
    column.pairs = pairsAt(dx, dy, width_, height_);
    column.p = intersection(reach, column.pairs);
    std::fill(column.weight.begin(), column.weight.end(), 0.0f);
    for (int x = column.p.x0; x < column.p.x1; ++x)
      column.inverseCount[static_cast<size_t>(x - column.p.x0)] =
          1.0f / static_cast<float>(3 * patchCount(x, 1, column.pairs.x0, column.pairs.x1));
    const double distance2 = dx * dx + dy * dy;
    column.spatial = static_cast<float>(-static_cast<double>(kLog2E) * distance2 /
                                        (2 * kPatchWelchSpatialSd * kPatchWelchSpatialSd));
  }

  // Row y of z², summed over three neighbours in x, of every image; zeros outside the image.
  void patchRow(Column& column, int y, int dx, int dy) {
    const PixelRect &p = column.p, &pairs = column.pairs;
    const int count = roundUp(p.width());
    if (y < pairs.y0 || y >= pairs.y1) {
      for (size_t i = 0; i < images_; ++i) std::fill_n(column.patchRow(i, y), count, 0.0f);
      return;
    }
    const int x0 = std::max(p.x0 - 1, pairs.x0), x1 = std::min(p.x1 + 1, pairs.x1), padded = roundUp(x1 - x0);
    const ptrdiff_t at = tile_.index(x0, y), to = tile_.index(x0 + dx, y + dy);
    inverseVarianceRow(rowsAt(tile_.variance, at), rowsAt(tile_.variance, to), padded,
                       {inverse_[0].data(), inverse_[1].data(), inverse_[2].data()});
    float* z2 = difference_.data() + (x0 - (p.x0 - 1));  // difference_[0] belongs to p.x0 - 1
    difference_[0] = 0;
    for (size_t i = 0; i < images_; ++i) {
      differenceRow(rowsAt(tile_.radiance[i], at), rowsAt(tile_.radiance[i], to),
                    {inverse_[0].data(), inverse_[1].data(), inverse_[2].data()}, padded, z2);
      std::fill(z2 + (x1 - x0), z2 + padded + 2, 0.0f);
      boxRow(difference_.data(), count, column.patchRow(i, y));
    }
  }

  // Adds the pairs of row y at all dx to the sums of both pixels.
  void accumulate(int y, int dy) {
    for (Column& column : columns_) column.edgeReady = false;
    for (size_t i = 0; i < images_; ++i)
      for (size_t k = 0; k < thresholds_.size(); ++k) {
        ofFirst_.clear();
        ofSecond_.clear();
        for (int dx = -kPatchWelchWindow; dx <= kPatchWelchWindow; ++dx)
          if (!columnOf(dx).p.empty() && weigh(columnOf(dx), y, dx, dy, i, thresholds_[k]))
            listRows(columnOf(dx), y, dx, dy, tile_.radiance[i]);
        Sums& sums = sums_[k * images_ + i];
        const int count = roundUp(target_.width());
        if (y >= target_.y0) addRows(ofFirst_, count, sums, sumIndex(target_.x0, y));
        if (y + dy < target_.y1) addRows(ofSecond_, count, sums, sumIndex(target_.x0, y + dy));
      }
  }

  // Row y of the weights of an image; whether any is positive.
  bool weigh(Column& column, int y, int dx, int dy, size_t image, float squaredThreshold) {
    const PixelRect &p = column.p, &pairs = column.pairs;
    const int count = roundUp(p.width());
    const float inverseRows = 1.0f / static_cast<float>(patchCount(y, 1, pairs.y0, pairs.y1));
    const float scale = inverseRows / (squaredThreshold * PatchWelchInput::varianceFactor(image));
    float* weight = column.weight.data() + weightIndex(p.x0);
    if (!toleranceRow({column.patchRow(image, y - 1), column.patchRow(image, y), column.patchRow(image, y + 1)},
                      column.inverseCount.data(), scale, count, weight))
      return false;
    if (!column.edgeReady)
      edgeRow(tile_, tile_.index(p.x0, y), tile_.index(p.x0 + dx, y + dy), column.spatial, count, column.edge.data());
    column.edgeReady = true;
    weightRow(weight, column.edge.data(), count);
    std::fill(weight + p.width(), weight + count, 0.0f);
    return true;
  }

  // The weights of a dx add q to the sums of p, and p to those of q.
  void listRows(const Column& column, int y, int dx, int dy, const PatchWelchTile::Plane3& u) {
    const float* weight = column.weight.data();
    ofFirst_.push_back({weight + weightIndex(target_.x0), rowsAt(u, tile_.index(target_.x0 + dx, y + dy))});
    ofSecond_.push_back({weight + weightIndex(target_.x0 - dx), rowsAt(u, tile_.index(target_.x0 - dx, y))});
  }

  ptrdiff_t weightIndex(int x) const { return x - (target_.x0 - kPatchWelchWindow); }

  PixelRect target_;
  int width_, height_;  // of the image
  const std::vector<float>& thresholds_;
  PatchWelchTile tile_;
  size_t images_;
  int row_;                 // floats of a row of any buffer
  std::vector<Sums> sums_;  // [threshold][image]
  std::array<std::vector<float>, 3> inverse_;
  std::array<Column, 2 * kPatchWelchWindow + 1> columns_;  // by dx
  std::vector<float> difference_;
  std::vector<WeightedRow> ofFirst_, ofSecond_;  // what is added to the sums of p, and of q
};

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
                                                TileSize tiles, const std::atomic<bool>* cancel) {
  BRAID_ASSERT(!thresholds.empty() && !input.images.empty() && input.images.size() <= PatchWelchInput::kMaxImages);
  const int width = input.width(), height = input.height();
  std::vector<std::vector<Rgb<float>>> out(thresholds.size(),
                                           std::vector<Rgb<float>>(input.images.size(), Rgb<float>(width, height)));
  std::vector<float> squared;
  for (const double z : thresholds) squared.push_back(squaredThreshold(z, input.passes));
  forEachTile(width, height, tiles.width, tiles.height, [&](const PixelRect& tile) {
    if (cancel && cancel->load(std::memory_order_relaxed)) return;
    TileFilter filter(input, squared, tile);
    runVectorised([&] { filter.run(); });
    filter.write(out);
  });
  return out;
}

}  // namespace braid
