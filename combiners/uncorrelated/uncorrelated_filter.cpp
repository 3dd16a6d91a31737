// SPDX-License-Identifier: Apache-2.0
#include "combiners/uncorrelated/uncorrelated_filter.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/window.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/pixels/mirror.h"
#include "combiners/pixels/packed_rows.h"
#include "combiners/pixels/pair_rows.h"

namespace braid {

namespace {

constexpr int kRadius = 7;
constexpr float kNeighbours = (2 * kRadius + 1) * (2 * kRadius + 1) - 1;
constexpr int kTileWidth = 128, kTileHeight = 32;
// Pairs at a time, past the end of a row as well: what is left over of vectors would take as long as they all.
constexpr int kUnit = 8;
static_assert(kUnit <= PackedRows::kSlack);
constexpr int kBlock = 128;  // columns at a time: the sums of all candidates stay in the first cache
// Weights below 2^-80 are nothing, and their products would be subnormal numbers, which take hundreds of cycles.
constexpr int kLowestExponent = -80;
constexpr size_t kCandidates = kUncorrelatedGammas.size();

// a - b with mirrored pixels around it.
Plane<float> paddedDifference(const Plane<float>& a, const Plane<float>& b) {
  Plane<float> out(a.width, a.height);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = a[i] - b[i];
  });
  return mirrorPadded(out, kRadius);
}

// Pixels of one row from some column on: h, g and the noise.
struct Pixels {
  const float *h, *g, *noise;
};

// h and g of one channel, and the noise of its pixels: none if neighbours are not chosen by it.
class Padded {
 public:
  Padded(const UncorrelatedInputs& in, size_t c)
      : width_(in.first->width()), height_(in.first->height()), rows_(packed(in, c)) {}
  // The image with the pixels around it.
  PixelRect around() const { return grown({0, 0, width_, height_}, kRadius); }
  Pixels at(int x, int y) const {
    const float* h = rows_.row(0, y + kRadius) + x + kRadius;
    return {h, h + rows_.pitch(), h + 2 * rows_.pitch()};
  }

 private:
  static PackedRows packed(const UncorrelatedInputs& in, size_t c) {
    const Plane<float> h = paddedDifference((*in.first)[c], (*in.second)[c]);
    const Plane<float> g = paddedDifference((*in.correlated)[c], (*in.independent)[c]);
    const Plane<float> noise = in.noise ? mirrorPadded((*in.noise)[c], kRadius) : Plane<float>(h.width, h.height);
    return PackedRows({&h, &g, &noise});
  }

  int width_, height_;
  PackedRows rows_;
};

// How the differences of h make weights: k = exp2(gamma `exponent` (h_c - h_i)²).
struct Weighting {
  float exponent = 0;  // -n log2(e)
  float mostNoise = 0;
};
constexpr float kNever = -1e9f;
// The exponent of a pair. Both pixels see the same, so that what one loses to the other comes back.
inline float exponentOf(float d, float noise, float other, const Weighting& by) {
  const float exponent = by.exponent * (d * d);
  return std::max(noise, other) > by.mostNoise * std::min(noise, other) ? kNever : exponent;
}
Weighting weightingOf(const UncorrelatedInputs& in, double gamma) {
  return {-static_cast<float>(gamma * in.samples) * kLog2E, static_cast<float>(in.mostNoise)};
}

// k (g_p - g_q) of `count` pairs of one gamma, which `by` holds already.
void termsOfRow(const Pixels& first, const Pixels& second, Weighting by, int count, float* __restrict out) {
  const float* __restrict hp = first.h, * __restrict hq = second.h;
  const float* __restrict gp = first.g, * __restrict gq = second.g;
  const float* __restrict np = first.noise, * __restrict nq = second.noise;
  for (int x = 0; x < count; ++x) {
    const float e = exponentOf(hp[x] - hq[x], np[x], nq[x], by);
    out[x] = exp2NonPositive<kLowestExponent>(e) * (gp[x] - gq[x]);
  }
}

// Σ k (g_c - g_i) of one gamma for the pixels of a tile, row by row. What a pair adds to one of its pixels, it takes
// from the other.
void tileSums(const Padded& in, const Weighting& by, const PixelRect& tile, float* sums) {
  const auto at = [&](int x, int y) { return sums + static_cast<ptrdiff_t>(y - tile.y0) * tile.width() + x - tile.x0; };
  forPairRows(tile, in.around(), kRadius, 1, [&](const PairRow& row) {
    const Columns all = row.all();
    float terms[kTileWidth + kRadius + kUnit];
    termsOfRow(in.at(all.begin, row.y), in.at(all.begin + row.dx, row.y + row.dy), by, roundUp(all.count(), kUnit),
               terms);
    if (!row.first.empty()) {
      float* __restrict sum = at(row.first.begin, row.y);
      const float* __restrict term = terms + (row.first.begin - all.begin);
      for (int x = 0; x < row.first.count(); ++x) sum[x] += term[x];
    }
    if (!row.second.empty()) {
      float* __restrict sum = at(row.second.begin + row.dx, row.y + row.dy);
      const float* __restrict term = terms + (row.second.begin - all.begin);
      for (int x = 0; x < row.second.count(); ++x) sum[x] -= term[x];
    }
  });
}

// Adds the terms of one neighbour for `count` pixels of a row to the sums of all candidates. Three exponentials are
// enough, the other weights are products of them. Weights below 10⁻¹⁸ are raised to it before they are multiplied, so
// that no product is subnormal.
void addAll(const Pixels& centre, const Pixels& neighbour, Weighting by, int count,
            float (&__restrict sums)[kCandidates][kBlock]) {
  constexpr float kTiny = 1e-18f;
  const float* __restrict hc = centre.h, * __restrict hi = neighbour.h;
  const float* __restrict gc = centre.g, * __restrict gi = neighbour.g;
  const float* __restrict nc = centre.noise, * __restrict ni = neighbour.noise;
  for (int x = 0; x < count; ++x) {
    const float g = gc[x] - gi[x], e = exponentOf(hc[x] - hi[x], nc[x], ni[x], by);
    const float k001 = exp2NonPositive<kLowestExponent>(0.01f * e);
    const float k0025 = std::max(exp2NonPositive(0.025f * e), kTiny), k005 = std::max(k0025 * k0025, kTiny);
    const float k01 = std::max(k005 * k005, kTiny), k02 = k01 * k01;
    const float k05 = std::max(exp2NonPositive(0.5f * e), kTiny), k1 = std::max(k05 * k05, kTiny);
    const float k15 = k1 * k05, k2 = std::max(k1 * k1, kTiny), k25 = k2 * k05;
    sums[0][x] += k001 * g;
    sums[1][x] += k0025 * g;
    sums[2][x] += k005 * g;
    sums[3][x] += k01 * g;
    sums[4][x] += k02 * g;
    sums[5][x] += k05 * g;
    sums[6][x] += k1 * g;
    sums[7][x] += k15 * g;
    sums[8][x] += k2 * g;
    sums[9][x] += k25 * g;
  }
}

// Calls add(pixels, neighbours) for every neighbour of the pixels from (x0, y) on.
template <class Add>
void forNeighbours(const Padded& in, int x0, int y, const Add& add) {
  const Pixels centre = in.at(x0, y);
  for (int dy = -kRadius; dy <= kRadius; ++dy)
    for (int dx = -kRadius; dx <= kRadius; ++dx)
      if (dx != 0 || dy != 0) add(centre, in.at(x0 + dx, y + dy));
}

// Σ k (g_c - g_i) / 224 of every candidate for `count` pixels of row y.
void candidateSums(const Padded& in, const Weighting& by, int x0, int y, int count,
                   float (&sums)[kCandidates][kBlock]) {
  for (auto& row : sums) std::fill_n(row, kBlock, 0.0f);
  runVectorised([&] {
    forNeighbours(in, x0, y,
                  [&](const Pixels& centre, const Pixels& neighbour) { addAll(centre, neighbour, by, count, sums); });
  });
  for (auto& row : sums)
    for (float& s : row) s /= kNeighbours;
}

// The scores of the pixels of one row of a channel, added to `scores`. `level` is ybar.
void addRowScores(const Padded (&in)[2], const UncorrelatedInputs (&groups)[2], const Plane<double>& level, size_t c,
                  int y, std::array<double, kCandidates>& scores) {
  float sums[2][kCandidates][kBlock];
  const int width = level.width;
  for (int x0 = 0; x0 < width; x0 += kBlock) {
    const int count = std::min(kBlock, width - x0);
    for (size_t j = 0; j < 2; ++j) candidateSums(in[j], weightingOf(groups[j], 1), x0, y, count, sums[j]);
    for (int x = 0; x < count; ++x) {
      const size_t i = level.index(x0 + x, y);
      const double base =
          static_cast<double>((*groups[0].independent)[c][i]) - static_cast<double>((*groups[1].independent)[c][i]);
      for (size_t k = 0; k < kCandidates; ++k) {
        const double d = base + static_cast<double>(sums[0][k][x]) - static_cast<double>(sums[1][k][x]);
        scores[k] += d * d / (level[i] * level[i] + 0.01);
      }
    }
  }
}

}  // namespace

Rgb<float> uncorrelatedFiltered(const UncorrelatedInputs& in, double gamma) {
  const Rgb<float>& y = *in.independent;
  const Weighting by = weightingOf(in, gamma);
  Rgb<float> out(y.width(), y.height());
  for (size_t c = 0; c < 3; ++c) {
    const Padded planes(in, c);
    forEachTile(y.width(), y.height(), kTileWidth, kTileHeight, [&](const PixelRect& tile) {
      std::vector<float> sums(static_cast<size_t>(tile.width()) * static_cast<size_t>(tile.height()), 0.0f);
      runVectorised([&] { tileSums(planes, by, tile, sums.data()); });
      const float* sum = sums.data();
      for (int row = tile.y0; row < tile.y1; ++row)
        for (int x = tile.x0; x < tile.x1; ++x) out[c].at(x, row) = y[c].at(x, row) + *sum++ / kNeighbours;
    });
  }
  return out;
}

Rgb<float> uniformlyFiltered(const Rgb<float>& independent, const Rgb<float>& correlated) {
  Rgb<float> out(independent.width(), independent.height());
  for (size_t c = 0; c < 3; ++c) {
    Plane<float> g = correlated[c];
    for (size_t i = 0; i < g.size(); ++i) g[i] -= independent[c][i];
    const Plane<double> mean = mirrorBoxMean(g, kRadius);
    for (size_t i = 0; i < g.size(); ++i) out[c][i] = finiteFloat(static_cast<double>(correlated[c][i]) - mean[i]);
  }
  return out;
}

std::array<double, kCandidates> uncorrelatedScores(const UncorrelatedInputs (&groups)[2], const Rgb<float>& guide,
                                                   int rowStep) {
  const int height = guide.height(), rows = (height + rowStep - 1) / rowStep;
  std::array<double, kCandidates> total{};
  for (size_t c = 0; c < 3; ++c) {
    const Padded planes[2] = {{groups[0], c}, {groups[1], c}};
    const Plane<double> level = mirrorBoxMean(guide[c], kRadius);
    std::vector<std::array<double, kCandidates>> ofRow(static_cast<size_t>(rows));
    parallelRows(rows, [&](int r) {
      ofRow[static_cast<size_t>(r)] = {};
      addRowScores(planes, groups, level, c, r * rowStep, ofRow[static_cast<size_t>(r)]);
    });
    for (const auto& row : ofRow)
      for (size_t k = 0; k < kCandidates; ++k) total[k] += row[k];
  }
  for (double& score : total) score /= 3.0 * rows * guide.width();
  return total;
}

double bestGamma(const std::array<double, kCandidates>& scores) {
  size_t best = 0;
  for (size_t k = 1; k < kCandidates; ++k)
    if (std::isfinite(scores[k]) && (!std::isfinite(scores[best]) || scores[k] < scores[best])) best = k;
  return static_cast<double>(kUncorrelatedGammas[best]);
}

}  // namespace braid
