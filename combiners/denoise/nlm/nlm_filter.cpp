// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/nlm/nlm_filter.h"

#include <cstddef>
#include <type_traits>

#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr int kTileWidth = 256, kTileHeight = 32;
constexpr int kUnit = 16;  // rows of pairs are rounded up to whole vectors, of what lies past the end nothing is kept
constexpr float kMaxDistance = 1e4f;
constexpr float kLargest = 1e18f;  // of means, and its square of variances: what is computed from them stays finite
// Weights below 2^-60 are 0: their products with colours would be subnormal, which processors take a hundred times
// longer over.
constexpr float kLowestExponent = -60;

// How far two pixels may count as apart: a distance times k² is at most `most`; `epsilon` goes to its denominator.
struct DistanceLimits {
  float epsilon, most;
};

// The distances of `count` pairs times k², summed over kChannels channels, to out[x], or added to it. `p` and `q` are
// the first pixels of the two rows; a channel is its mean times k and its variance times k², in rows `pitch` apart.
template <int kChannels, bool kAdd>
void addDistances(const float* __restrict p, const float* __restrict q, size_t pitch, DistanceLimits limits, int count,
                  float* __restrict out) {
  const float epsilon = limits.epsilon, most = limits.most;
  for (int x = 0; x < count; ++x) {
    float sum = kAdd ? out[x] : 0.0f;
    for (int c = 0; c < kChannels; ++c) {
      const size_t mean = 2 * static_cast<size_t>(c) * pitch + static_cast<size_t>(x), variance = mean + pitch;
      const float difference = p[mean] - q[mean], vp = p[variance], vq = q[variance];
      const float d = (difference * difference - (vp + std::min(vp, vq))) / (vp + vq + epsilon);
      sum += d < most ? d : most;
    }
    out[x] = sum;
  }
}

// out[x] = in[x] + ... + in[x + 2 radius], added from left to right.
template <int kRadius>
void boxRow(const float* __restrict in, int count, float* __restrict out) {
  for (int x = 0; x < count; ++x) {
    float sum = in[x];
    for (int k = 1; k <= 2 * kRadius; ++k) sum += in[x + k];
    out[x] = sum;
  }
}
void boxRow(int radius, const float* in, int count, float* out) {
  switch (radius) {
    case 0:
      return boxRow<0>(in, count, out);
    case 1:
      return boxRow<1>(in, count, out);
    case 2:
      return boxRow<2>(in, count, out);
    case 3:
      return boxRow<3>(in, count, out);
    default:
      break;
  }
  std::copy_n(in, count, out);
  for (int k = 1; k <= 2 * radius; ++k)
    for (int x = 0; x < count; ++x) out[x] += in[x + k];
}

// The exponents of two rows that follow each other: sums over the patches times scales, kept only where they are less
// than what the row holds, unless this is the first guide. The patches share all rows but their first and last: those
// kShared rows are added once, in order.
struct PatchRows {
  const float *first, *shared, *last;
  size_t pitch;           // of the shared rows
  const float* scale;     // of a column,
  float inverseY, nextY;  // and of both rows
};
template <int kShared, bool kFirst>
void patchRows(const PatchRows& rows, int count, float* __restrict out, float* __restrict next) {
  const float* __restrict first = rows.first, * __restrict in = rows.shared, * __restrict last = rows.last;
  const float* __restrict scale = rows.scale;
  for (int x = 0; x < count; ++x) {
    float shared = kShared > 0 ? in[x] : 0.0f;
    for (size_t k = 1; k < kShared; ++k) shared += in[static_cast<size_t>(x) + k * rows.pitch];
    const float a = (first[x] + shared) * (scale[x] * rows.inverseY);
    const float b = (shared + last[x]) * (scale[x] * rows.nextY);
    out[x] = kFirst || a < out[x] ? a : out[x];
    next[x] = kFirst || b < next[x] ? b : next[x];
  }
}
// `sums` has room for a row.
template <bool kFirst>
void patchRows(PatchRows rows, int radius, int count, float* sums, float* out, float* next) {
  switch (radius) {
    case 0:
      return patchRows<0, kFirst>(rows, count, out, next);
    case 1:
      return patchRows<2, kFirst>(rows, count, out, next);
    case 2:
      return patchRows<4, kFirst>(rows, count, out, next);
    case 3:
      return patchRows<6, kFirst>(rows, count, out, next);
    default:
      break;
  }
  std::copy_n(rows.shared, count, sums);
  for (size_t k = 1; k < static_cast<size_t>(2 * radius); ++k)
    for (size_t x = 0; x < static_cast<size_t>(count); ++x) sums[x] += rows.shared[x + k * rows.pitch];
  rows.shared = sums;
  patchRows<1, kFirst>(rows, count, out, next);
}

void weightsFromExponents(float* __restrict w, int count) {
  for (int x = 0; x < count; ++x) {
    const float exponent = w[x] < 0 ? w[x] : 0.0f;
    w[x] = exponent > kLowestExponent ? exp2NonPositive(exponent) : 0.0f;
  }
}

// The filter in one tile.
void filterTile(std::span<const NlmGuide> guides, int window, std::span<const Plane<float>* const> in,
                std::span<Plane<float>* const> out, const PixelRect& tile) {
  NlmWeights weights(guides, window, tile);
  TileSums sums(tile, window, in, false);
  for (int dy = -window; dy <= window; ++dy)
    for (int dx = -window; dx <= window; ++dx)
      if (!intersection(tile, pairsAt(dx, dy, in[0]->width, in[0]->height)).empty())
        sums.add(weights.at(dx, dy), dx, dy);
  sums.finish();
  for (size_t t = 0; t < in.size(); ++t) sums.mean(t, false, *out[t]);
}

}  // namespace

NlmGuide nlmGuide(const Plane<float>& mean, const Plane<float>& variance, float k, int patch) {
  NlmGuide guide;
  guide.mean = {&mean};
  guide.variance = {&variance};
  guide.k = k;
  guide.patch = patch;
  return guide;
}

NlmGuide nlmGuide(const Rgb<float>& mean, const Rgb<float>& variance, float k, int patch) {
  NlmGuide guide;
  for (size_t c = 0; c < 3; ++c) {
    guide.mean.push_back(&mean[c]);
    guide.variance.push_back(&variance[c]);
  }
  guide.k = k;
  guide.patch = patch;
  return guide;
}

// A guide's planes about a tile: row by row, of every channel the mean times k and the variance times k².
NlmWeights::Guide::Guide(const NlmGuide& guide, const PixelRect& around)
    : area(around),
      channels(static_cast<int>(guide.mean.size())),
      patch(guide.patch),
      squareK(guide.k * guide.k),
      epsilon(guide.epsilon),
      pitch(static_cast<size_t>(roundUp(around.width(), kUnit))) {
  if (pitch % 1024 == 0) pitch += kUnit;  // rows 4 KiB apart would share one set of the cache
  data.resize(2 * guide.mean.size() * pitch * static_cast<size_t>(area.height()) + kUnit);
  float* out = data.data();
  for (int y = area.y0; y < area.y1; ++y)
    for (size_t c = 0; c < guide.mean.size(); ++c, out += 2 * pitch) {
      const float *mean = &guide.mean[c]->at(area.x0, y), *variance = &guide.variance[c]->at(area.x0, y);
      for (size_t x = 0; x < static_cast<size_t>(area.width()); ++x) {
        out[x] = std::clamp(guide.k * mean[x], -kLargest, kLargest);
        out[pitch + x] = std::min(guide.varianceScale * squareK * variance[x], kLargest * kLargest);
      }
    }
}

const float* NlmWeights::Guide::at(int x, int y) const {
  return data.data() + static_cast<size_t>((y - area.y0) * 2 * channels) * pitch + (x - area.x0);
}

void NlmWeights::Guide::distances(int dx, int dy, int y, int x0, int count, float* out) const {
  const float *p = at(x0, y), *q = at(x0 + dx, y + dy);
  const DistanceLimits limits{epsilon, squareK * kMaxDistance};
  int c = 0;
  const auto next = [&]<int kChannels>(std::integral_constant<int, kChannels>) {
    if (c == 0)
      addDistances<kChannels, false>(p, q, pitch, limits, count, out);
    else
      addDistances<kChannels, true>(p, q, pitch, limits, count, out);
    c += kChannels;
    p += 2 * kChannels * pitch;
    q += 2 * kChannels * pitch;
  };
  while (c + 3 <= channels) next(std::integral_constant<int, 3>{});
  while (c < channels) next(std::integral_constant<int, 1>{});
}

NlmWeights::NlmWeights(std::span<const NlmGuide> guides, int window, const PixelRect& tile) : tile_(tile) {
  BRAID_ASSERT(!guides.empty() && window >= 0);
  int patch = 0;
  for (const NlmGuide& g : guides) {
    BRAID_ASSERT(!g.mean.empty() && g.variance.size() == g.mean.size() && g.patch >= 0);
    patch = std::max(patch, g.patch);
  }
  width_ = guides[0].mean[0]->width;
  height_ = guides[0].mean[0]->height;
  for (const NlmGuide& g : guides)
    guides_.emplace_back(g, intersection(grown(tile, window + g.patch), {0, 0, width_, height_}));
  const auto width = static_cast<size_t>(tile.width()), height = static_cast<size_t>(tile.height());
  const auto margin = static_cast<size_t>(2 * patch);
  for (std::vector<float>& w : weights_) w.resize(width * height);
  difference_.resize(width + margin + kUnit);
  rowSums_.resize(width * (height + margin + 2));
  for (std::vector<float>* row : {&columnScales_, &patchSums_, &unused_}) row->resize(width);
}

// Rows of the image are taken in pairs of an even and an odd one, whatever the tile: the order of a pixel's additions
// depends on which of the two it is in.
void NlmWeights::addGuide(const Guide& guide, int dx, int dy, const PixelRect& inside, float* weights) {
  const int radius = guide.patch, count = inside.width();
  const PixelRect pairs = pairsAt(dx, dy, width_, height_), needed = intersection(grown(inside, radius), pairs);
  const int begin = inside.y0 / 2 * 2, end = (inside.y1 + 1) / 2 * 2;
  // Rows of `difference_` begin at inside.x0 - radius and are zero outside the image; rows of `rowSums_` begin at
  // inside.x0, the first is that of begin - radius.
  const auto sums = [&](int y) { return rowSums_.data() + static_cast<ptrdiff_t>(y - (begin - radius)) * count; };
  std::fill(difference_.begin(), difference_.end(), 0.0f);
  for (int y = begin - radius; y < end + radius; ++y) {
    if (y < needed.y0 || y >= needed.y1) {
      std::fill_n(sums(y), count, 0.0f);
      continue;
    }
    float* differences = difference_.data() + (needed.x0 - (inside.x0 - radius));
    guide.distances(dx, dy, y, needed.x0, roundUp(needed.width(), kUnit), differences);
    std::fill_n(differences + needed.width(), kUnit, 0.0f);
    boxRow(radius, difference_.data(), count, sums(y));
  }
  const float scale = -kLog2E / (guide.squareK * static_cast<float>(guide.channels));
  for (int x = 0; x < count; ++x)
    columnScales_[static_cast<size_t>(x)] =
        scale / static_cast<float>(patchCount(inside.x0 + x, radius, pairs.x0, pairs.x1));
  const auto inverseY = [&](int y) { return 1.0f / static_cast<float>(patchCount(y, radius, pairs.y0, pairs.y1)); };
  const auto row = [&](int y) {
    return y < inside.y0 || y >= inside.y1 ? unused_.data()
                                           : weights + (y - tile_.y0) * tile_.width() + (inside.x0 - tile_.x0);
  };
  for (int y = begin; y < end; y += 2) {
    const PatchRows rows = {
        sums(y - radius),     sums(y - radius + 1), sums(y + radius + 1), static_cast<size_t>(count),
        columnScales_.data(), inverseY(y),          inverseY(y + 1)};
    if (&guide == &guides_.front())
      patchRows<true>(rows, radius, count, patchSums_.data(), row(y), row(y + 1));
    else
      patchRows<false>(rows, radius, count, patchSums_.data(), row(y), row(y + 1));
    if (&guide != &guides_.back()) continue;
    weightsFromExponents(row(y), count);
    weightsFromExponents(row(y + 1), count);
  }
}

// Zeros in the pixels of the tile that have no partner.
void NlmWeights::clearOutside(const PixelRect& inside, float* weights) const {
  const int width = tile_.width();
  for (int y = tile_.y0; y < tile_.y1; ++y, weights += width) {
    const bool none = y < inside.y0 || y >= inside.y1;
    std::fill(weights, weights + (none ? width : inside.x0 - tile_.x0), 0.0f);
    if (!none) std::fill(weights + (inside.x1 - tile_.x0), weights + width, 0.0f);
  }
}

const float* NlmWeights::at(int dx, int dy) {
  const PixelRect inside = intersection(tile_, pairsAt(dx, dy, width_, height_));
  float* weights = weights_[next_].data();
  next_ = (next_ + 1) % weights_.size();
  if (inside.empty()) {
    clearOutside({}, weights);
    return weights;
  }
  clearOutside(inside, weights);
  runVectorised([&] {
    for (const Guide& g : guides_) addGuide(g, dx, dy, inside, weights);
  });
  return weights;
}

void nlmFilter(std::span<const NlmGuide> guides, int window, std::span<const Plane<float>* const> in,
               std::span<Plane<float>* const> out) {
  BRAID_ASSERT(in.size() == out.size() && window >= 0);
  if (in.empty() || in[0]->empty()) return;
  for (size_t t = 0; t < in.size(); ++t)
    BRAID_ASSERT(in[t]->size() == guides[0].mean[0]->size() && out[t]->size() == in[t]->size());
  forEachTile(in[0]->width, in[0]->height, kTileWidth, kTileHeight,
              [&](const PixelRect& tile) { filterTile(guides, window, in, out, tile); });
}

Rgb<float> nlmFilter(const NlmGuide& guide, int window, const Rgb<float>& in) {
  Rgb<float> out(in.width(), in.height());
  const std::array<const Plane<float>*, 3> from = {&in[0], &in[1], &in[2]};
  const std::array<Plane<float>*, 3> to = {&out[0], &out[1], &out[2]};
  nlmFilter(std::span(&guide, 1), window, from, to);
  return out;
}

}  // namespace braid
