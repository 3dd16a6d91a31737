// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble/weight_bilateral.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/window.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/pixels/pair_rows.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr int kRadius = 7;
constexpr int kTileWidth = 64, kTileHeight = 32;
// Pairs at a time, past the end of a row as well: what is left over of vectors would take as long as they all.
constexpr int kUnit = 8;
static_assert(kRadius <= kUnit);
constexpr float kRounding = 1e-5f;  // of sums of weights
// Weights below 2^-80 are nothing, and their products would be subnormal numbers, which take hundreds of cycles.
constexpr int kLowestExponent = -80;
constexpr float kSpatial = 3.0f, kColour = 2.0f, kAlbedo = 0.25f, kNormal = 0.15f;

constexpr float exponentScale(float sigma) { return kLog2E / (2 * sigma * sigma); }

// V and the share of eps of every pixel.
Plane<float> guideVariance(const Estimate& guide) {
  Plane<float> out(guide.mean.width(), guide.mean.height(), kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      double v = 0, square = 0;
      for (size_t c = 0; c < 3; ++c) {
        v += 0.5 * sqr(static_cast<double>(guide.half[0][c][i]) - static_cast<double>(guide.half[1][c][i]));
        square += sqr(static_cast<double>(guide.mean[c][i]));
      }
      out[i] = finiteFloat(v + 0.5 * (1e-10 + 1e-6 * square));
    }
  });
  return out;
}

struct Guides {
  const Rgb<float>* colour = nullptr;
  const Plane<float>* variance = nullptr;
  const Rgb<float>*albedo = nullptr, *normal = nullptr;  // or null
};

// The three rows of an image from a pixel on; null without an image.
struct Rows3 {
  const float *r = nullptr, *g = nullptr, *b = nullptr;
  Rows3(const Rgb<float>* image, size_t i) {
    if (image) r = &(*image)[0][i], g = &(*image)[1][i], b = &(*image)[2][i];
  }
};

// |p - q|² of pixel x of two rows.
inline float squaredDistance(const Rows3& p, const Rows3& q, int x) {
  const float r = p.r[x] - q.r[x], g = p.g[x] - q.g[x], b = p.b[x] - q.b[x];
  return r * r + g * g + b * b;
}

template <bool kHasAlbedo, bool kHasNormal>
void kernelOfRow(const Guides& guides, size_t p, size_t q, float spatial, int count, float* __restrict out) {
  const Rows3 colourP(guides.colour, p), colourQ(guides.colour, q);
  const Rows3 albedoP(guides.albedo, p), albedoQ(guides.albedo, q);
  const Rows3 normalP(guides.normal, p), normalQ(guides.normal, q);
  const float *vp = guides.variance->data.data() + p, *vq = guides.variance->data.data() + q;
  for (int x = 0; x < count; ++x) {
    float e = spatial + exponentScale(kColour) * (squaredDistance(colourP, colourQ, x) / (vp[x] + vq[x]));
    if (kHasAlbedo) e += exponentScale(kAlbedo) * squaredDistance(albedoP, albedoQ, x);
    if (kHasNormal) e += exponentScale(kNormal) * squaredDistance(normalP, normalQ, x);
    out[x] = exp2NonPositive<kLowestExponent>(-e);
  }
}

// kappa(p, q) of `count` pixel pairs, from p and q on.
void kernelOfRow(const Guides& guides, size_t p, size_t q, float spatial, int count, float* out) {
  if (guides.albedo)
    guides.normal ? kernelOfRow<true, true>(guides, p, q, spatial, count, out)
                  : kernelOfRow<true, false>(guides, p, q, spatial, count, out);
  else
    guides.normal ? kernelOfRow<false, true>(guides, p, q, spatial, count, out)
                  : kernelOfRow<false, false>(guides, p, q, spatial, count, out);
}

// Filters one tile. The maps of the last base are what is left to 1.
class TileFilter {
 public:
  TileFilter(const WeightMaps& raw, const Guides& guides, const PixelRect& tile)
      : raw_(raw),
        guides_(guides),
        tile_(tile),
        shape_(raw.planes[0]),
        maps_(raw.planes.size() - raw.channels),
        area_(static_cast<size_t>(tile.width()) * static_cast<size_t>(tile.height())),
        norm_(area_, 1.0f),
        sums_(maps_ * area_) {}

  void filter(int step, WeightMaps& out) {
    startWithCentres();
    forPairRows(tile_, {0, 0, shape_.width, shape_.height}, kRadius, step, [&](const PairRow& row) { add(row); });
    for (int y = tile_.y0; y < tile_.y1; ++y) write(y, out);
  }

 private:
  // A pixel's own weights, of kappa = 1.
  void startWithCentres() {
    for (size_t m = 0; m < maps_; ++m)
      for (int y = tile_.y0; y < tile_.y1; ++y)
        std::copy_n(&raw_.planes[m].at(tile_.x0, y), tile_.width(), &sums_[m * area_ + at(tile_.x0, y)]);
  }

  void add(const PairRow& row) {
    const Columns all = row.all();
    const size_t p = shape_.index(all.begin, row.y), q = shape_.index(all.begin + row.dx, row.y + row.dy);
    const auto spatial = static_cast<float>(row.dx * row.dx + row.dy * row.dy) * exponentScale(kSpatial);
    const auto left = static_cast<int>(std::min<size_t>(shape_.size() - std::max(p, q), kTileWidth + 2 * kUnit));
    float kernel[kTileWidth + 2 * kUnit];
    kernelOfRow(guides_, p, q, spatial, std::min(roundUp(all.count(), kUnit), left), kernel);
    const int first = row.first.begin - all.begin, second = row.second.begin - all.begin;
    if (!row.first.empty())
      addWeighted(kernel + first, row.first.count(), q + static_cast<size_t>(first), at(row.first.begin, row.y));
    if (!row.second.empty())
      addWeighted(kernel + second, row.second.count(), p + static_cast<size_t>(second),
                  at(row.second.begin + row.dx, row.y + row.dy));
  }

  // Adds the weights from pixel `from` on to the sums from `to` on.
  void addWeighted(const float* __restrict kernel, int count, size_t from, size_t to) {
    float* __restrict norm = norm_.data() + to;
    for (int k = 0; k < count; ++k) norm[k] += kernel[k];
    for (size_t m = 0; m < maps_; ++m) {
      float* __restrict sum = sums_.data() + m * area_ + to;
      const float* __restrict weight = raw_.planes[m].data.data() + from;
      for (int k = 0; k < count; ++k) sum[k] += kernel[k] * weight[k];
    }
  }

  void write(int y, WeightMaps& out) const {
    for (size_t c = 0; c < out.channels; ++c)
      for (int x = tile_.x0; x < tile_.x1; ++x) {
        float sum = 0;
        for (size_t m = c; m < maps_; m += out.channels)
          sum += out.planes[m].at(x, y) = sums_[m * area_ + at(x, y)] / norm_[at(x, y)];
        const bool nothingLeft = std::fabs(1 - sum) < kRounding;
        for (size_t m = c; nothingLeft && m < maps_; m += out.channels) out.planes[m].at(x, y) /= sum;
        out.planes[maps_ + c].at(x, y) = nothingLeft ? 0 : 1 - sum;
      }
  }

  size_t at(int x, int y) const {
    return static_cast<size_t>(y - tile_.y0) * static_cast<size_t>(tile_.width()) + static_cast<size_t>(x - tile_.x0);
  }

  const WeightMaps& raw_;
  const Guides& guides_;
  const PixelRect tile_;
  const Plane<float>& shape_;
  const size_t maps_, area_;
  std::vector<float> norm_, sums_;
};

}  // namespace

WeightMaps filteredWeights(const WeightMaps& raw, const Estimate& guide, const Features* features, int step) {
  BRAID_ASSERT(step >= 1 && step <= kRadius);
  const Plane<float> variance = guideVariance(guide);
  Guides guides{&guide.mean, &variance, nullptr, nullptr};
  if (features && !features->albedo.mean.empty()) guides.albedo = &features->albedo.mean;
  if (features && !features->normal.mean.empty()) guides.normal = &features->normal.mean;
  WeightMaps out = raw;
  forEachTile(guide.mean.width(), guide.mean.height(), kTileWidth, kTileHeight, [&](const PixelRect& tile) {
    TileFilter filter(raw, guides, tile);
    runVectorised([&] { filter.filter(step, out); });
  });
  return out;
}

}  // namespace braid
