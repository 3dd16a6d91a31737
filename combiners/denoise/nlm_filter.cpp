// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/nlm_filter.h"

#include <cstddef>

#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr int kTileWidth = 256, kTileHeight = 32;
constexpr float kMaxDistance = 1e4f;
// Weights below 2^-60 are 0: their products with colours would be subnormal, which processors take a hundred times
// longer over.
constexpr float kLowestExponent = -60;

// out[x] += d² of one channel for `count` pairs; p and q are the first pixels of the two rows.
struct PairRows {
  const float *meanP, *meanQ, *varianceP, *varianceQ, *spreadP, *spreadQ;
};
void addDistances(const PairRows& rows, float varianceScale, float spreadScale, float epsilon, int count,
                  float* __restrict out) {
  const float* __restrict up = rows.meanP, * __restrict uq = rows.meanQ;
  const float* __restrict vp = rows.varianceP, * __restrict vq = rows.varianceQ;
  const float* __restrict sp = rows.spreadP, * __restrict sq = rows.spreadQ;
  for (int x = 0; x < count; ++x) {
    const float difference = up[x] - uq[x];
    const float expected = varianceScale * (vp[x] + std::min(vp[x], vq[x]));
    const float d = (difference * difference - expected) / (spreadScale * (sp[x] + sq[x]) + epsilon);
    out[x] += std::min(d, kMaxDistance);
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

// The patch distance of a row: the 2 radius + 1 rows from `first` on added in order, times the inverse counts; kept
// only where it is larger than what `out` holds, unless this is the first guide.
template <int kRadius>
void patchRow(const float* __restrict first, ptrdiff_t pitch, const float* __restrict inverse, float inverseY,
              int count, bool overwrite, float* __restrict out) {
  for (int x = 0; x < count; ++x) {
    float sum = first[x];
    for (int k = 1; k <= 2 * kRadius; ++k) sum += first[x + k * pitch];
    const float d = sum * (inverse[x] * inverseY);
    out[x] = overwrite || d > out[x] ? d : out[x];
  }
}
void patchRow(int radius, const float* first, ptrdiff_t pitch, const float* inverse, float inverseY, int count,
              bool overwrite, float* sums, float* out) {
  switch (radius) {
    case 0:
      return patchRow<0>(first, pitch, inverse, inverseY, count, overwrite, out);
    case 1:
      return patchRow<1>(first, pitch, inverse, inverseY, count, overwrite, out);
    case 2:
      return patchRow<2>(first, pitch, inverse, inverseY, count, overwrite, out);
    case 3:
      return patchRow<3>(first, pitch, inverse, inverseY, count, overwrite, out);
    default:
      break;
  }
  std::copy_n(first, count, sums);
  for (int k = 1; k <= 2 * radius; ++k)
    for (int x = 0; x < count; ++x) sums[x] += first[x + k * pitch];
  patchRow<0>(sums, 0, inverse, inverseY, count, overwrite, out);
}

void weightsFromDistances(float* __restrict w, int count) {
  for (int x = 0; x < count; ++x) {
    const float exponent = w[x] > 0 ? -kLog2E * w[x] : 0.0f;
    w[x] = exponent > kLowestExponent ? exp2NonPositive(exponent) : 0.0f;
  }
}

// The filter in one tile.
void filterTile(std::span<const NlmGuide> guides, int window, std::span<const Plane<float>* const> in,
                std::span<Plane<float>* const> out, const PixelRect& tile) {
  NlmWeights weights(guides, tile);
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

NlmWeights::NlmWeights(std::span<const NlmGuide> guides, const PixelRect& tile) : guides_(guides), tile_(tile) {
  BRAID_ASSERT(!guides.empty());
  int patch = 0;
  for (const NlmGuide& g : guides) {
    BRAID_ASSERT(!g.mean.empty() && g.variance.size() == g.mean.size() && g.patch >= 0 &&
                 (g.spread.empty() || g.spread.size() == g.mean.size()));
    patch = std::max(patch, g.patch);
  }
  width_ = guides[0].mean[0]->width;
  height_ = guides[0].mean[0]->height;
  const auto width = static_cast<size_t>(tile.width()), height = static_cast<size_t>(tile.height());
  const auto margin = static_cast<size_t>(2 * patch);
  for (std::vector<float>& w : weights_) w.resize(width * height);
  difference_.resize(width + margin);
  rowSums_.resize(width * (height + margin));
  inverseCounts_.resize(width);
  patchSums_.resize(width);
}

void NlmWeights::addGuide(const NlmGuide& guide, int dx, int dy, const PixelRect& inside, bool first, float* weights) {
  const int radius = guide.patch;
  const PixelRect pairs = pairsAt(dx, dy, width_, height_), needed = intersection(grown(inside, radius), pairs);
  const auto channels = static_cast<float>(guide.mean.size());
  const int count = inside.width();
  // Rows of `difference_` begin at inside.x0 - radius and are zero outside the image; rows of `rowSums_` begin at
  // inside.x0, the first is that of inside.y0 - radius.
  std::fill(difference_.begin(), difference_.end(), 0.0f);
  for (int y = inside.y0 - radius; y < inside.y1 + radius; ++y) {
    float* sums = rowSums_.data() + static_cast<ptrdiff_t>(y - (inside.y0 - radius)) * count;
    if (y < needed.y0 || y >= needed.y1) {
      std::fill_n(sums, count, 0.0f);
      continue;
    }
    float* differences = difference_.data() + (needed.x0 - (inside.x0 - radius));
    std::fill_n(differences, needed.width(), 0.0f);
    for (size_t c = 0; c < guide.mean.size(); ++c) {
      const size_t p = guide.mean[c]->index(needed.x0, y), q = guide.mean[c]->index(needed.x0 + dx, y + dy);
      const float *mean = guide.mean[c]->data.data(), *variance = guide.variance[c]->data.data();
      const float* spread = guide.spread.empty() ? variance : guide.spread[c]->data.data();
      addDistances({mean + p, mean + q, variance + p, variance + q, spread + p, spread + q}, guide.varianceScale,
                   guide.varianceScale * guide.k * guide.k, guide.epsilon, needed.width(), differences);
    }
    boxRow(radius, difference_.data(), count, sums);
  }
  for (int x = 0; x < count; ++x)
    inverseCounts_[static_cast<size_t>(x)] =
        1.0f / (channels * static_cast<float>(patchCount(inside.x0 + x, radius, pairs.x0, pairs.x1)));
  for (int y = inside.y0; y < inside.y1; ++y) {
    const float inverseY = 1.0f / static_cast<float>(patchCount(y, radius, pairs.y0, pairs.y1));
    patchRow(radius, rowSums_.data() + static_cast<ptrdiff_t>(y - inside.y0) * count, count, inverseCounts_.data(),
             inverseY, count, first, patchSums_.data(),
             weights + static_cast<ptrdiff_t>(y - tile_.y0) * tile_.width() + (inside.x0 - tile_.x0));
  }
}

const float* NlmWeights::at(int dx, int dy) {
  const PixelRect inside = intersection(tile_, pairsAt(dx, dy, width_, height_));
  std::vector<float>& buffer = weights_[next_];
  next_ = (next_ + 1) % weights_.size();
  if (inside.empty() || inside.width() < tile_.width() || inside.height() < tile_.height())
    std::fill(buffer.begin(), buffer.end(), 0.0f);
  float* weights = buffer.data();
  if (inside.empty()) return weights;
  runVectorised([&] {
    for (size_t g = 0; g < guides_.size(); ++g) addGuide(guides_[g], dx, dy, inside, g == 0, weights);
    for (int y = inside.y0; y < inside.y1; ++y)
      weightsFromDistances(weights + static_cast<ptrdiff_t>(y - tile_.y0) * tile_.width() + (inside.x0 - tile_.x0),
                           inside.width());
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
