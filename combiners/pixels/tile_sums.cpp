// SPDX-License-Identifier: Apache-2.0
#include "combiners/pixels/tile_sums.h"

#include <algorithm>

#include "renderer/core/error.h"

namespace braid {

namespace {

using Rows = std::array<const float*, TileSums::kAtOnce>;
static_assert(TileSums::kAtOnce == 4);

// 0 instead of what would be below 2^-60: subnormal numbers take a processor a hundred times longer.
inline float fourthPower(float w) {
  const float square = w * w;
  return w > 0x1p-15f ? square * square : 0.0f;
}

void addWeights(const Rows& weights, int count, float* __restrict sum) {
  const float* __restrict a = weights[0], * __restrict b = weights[1];
  const float* __restrict c = weights[2], * __restrict d = weights[3];
  for (int x = 0; x < count; ++x) sum[x] += (a[x] + b[x]) + (c[x] + d[x]);
}
void addFourthPowers(const Rows& weights, int count, float* __restrict sum) {
  const float* __restrict a = weights[0], * __restrict b = weights[1];
  const float* __restrict c = weights[2], * __restrict d = weights[3];
  for (int x = 0; x < count; ++x)
    sum[x] += (fourthPower(a[x]) + fourthPower(b[x])) + (fourthPower(c[x]) + fourthPower(d[x]));
}

void addWeighted(const Rows& weights, const Rows& in, int count, float* __restrict sum) {
  const float* __restrict a = weights[0], * __restrict b = weights[1];
  const float* __restrict c = weights[2], * __restrict d = weights[3];
  const float* __restrict e = in[0], * __restrict f = in[1], * __restrict g = in[2], * __restrict h = in[3];
  for (int x = 0; x < count; ++x) sum[x] += (a[x] * e[x] + b[x] * f[x]) + (c[x] * g[x] + d[x] * h[x]);
}
void addBoth(const Rows& weights, const Rows& in, int count, float* __restrict sum, float* __restrict fourth) {
  const float* __restrict a = weights[0], * __restrict b = weights[1];
  const float* __restrict c = weights[2], * __restrict d = weights[3];
  const float* __restrict e = in[0], * __restrict f = in[1], * __restrict g = in[2], * __restrict h = in[3];
  for (int x = 0; x < count; ++x) {
    sum[x] += (a[x] * e[x] + b[x] * f[x]) + (c[x] * g[x] + d[x] * h[x]);
    fourth[x] +=
        (fourthPower(a[x]) * e[x] + fourthPower(b[x]) * f[x]) + (fourthPower(c[x]) * g[x] + fourthPower(d[x]) * h[x]);
  }
}

}  // namespace

TileSums::TileSums(const PixelRect& tile, int window, std::span<const Plane<float>* const> in, bool fourthPowers)
    : tile_(tile),
      window_(window),
      planes_(in.size()),
      area_(static_cast<size_t>(tile.width()) * static_cast<size_t>(tile.height())),
      pitch_(static_cast<size_t>(tile.width() + 2 * window)),
      planeSize_(pitch_ * static_cast<size_t>(tile.height() + 2 * window)),
      fourthPowers_(fourthPowers),
      padded_(planes_ * planeSize_, 0.0f),
      sums_((planes_ + 1) * area_ * (fourthPowers ? 2 : 1), 0.0f),
      nothing_(area_, 0.0f) {
  BRAID_ASSERT(!in.empty() && window >= 0);
  const PixelRect around = grown(tile, window);
  const PixelRect inside = intersection(around, {0, 0, in[0]->width, in[0]->height});
  for (size_t p = 0; p < planes_; ++p)
    for (int y = inside.y0; y < inside.y1; ++y)
      std::copy_n(&in[p]->at(inside.x0, y), inside.width(),
                  padded_.data() + p * planeSize_ + static_cast<size_t>(y - around.y0) * pitch_ +
                      static_cast<size_t>(inside.x0 - around.x0));
}

void TileSums::add(const float* weights, int dx, int dy) {
  weights_[pending_] = weights;
  shifts_[pending_] = static_cast<size_t>(dy + window_) * pitch_ + static_cast<size_t>(dx + window_);
  if (++pending_ == kAtOnce) flush();
}

void TileSums::finish() {
  if (pending_ == 0) return;
  std::fill(weights_.begin() + static_cast<ptrdiff_t>(pending_), weights_.end(), nothing_.data());
  std::fill(shifts_.begin() + static_cast<ptrdiff_t>(pending_), shifts_.end(), 0);
  flush();
}

void TileSums::flush() {
  pending_ = 0;
  runVectorised([&] {
    const int width = tile_.width();
    for (size_t y = 0; y < static_cast<size_t>(tile_.height()); ++y) {
      const size_t at = y * static_cast<size_t>(width);
      Rows weights, in;
      for (size_t k = 0; k < kAtOnce; ++k) weights[k] = weights_[k] + at;
      for (size_t p = 0; p < planes_; ++p) {
        for (size_t k = 0; k < kAtOnce; ++k) in[k] = padded_.data() + p * planeSize_ + y * pitch_ + shifts_[k];
        if (fourthPowers_)
          addBoth(weights, in, width, sums(p) + at, sums(planes_ + 1 + p) + at);
        else
          addWeighted(weights, in, width, sums(p) + at);
      }
      addWeights(weights, width, sums(planes_) + at);
      if (fourthPowers_) addFourthPowers(weights, width, sums(2 * planes_ + 1) + at);
    }
  });
}

void TileSums::mean(size_t plane, bool fourthPower, Plane<float>& out) const {
  const size_t first = fourthPower ? planes_ + 1 : 0;
  const float *sum = sums_.data() + (first + plane) * area_, *total = sums_.data() + (first + planes_) * area_;
  for (int y = tile_.y0; y < tile_.y1; ++y) {
    const size_t row = static_cast<size_t>(y - tile_.y0) * static_cast<size_t>(tile_.width());
    float* to = &out.at(tile_.x0, y);
    for (size_t x = 0; x < static_cast<size_t>(tile_.width()); ++x) to[x] = sum[row + x] / total[row + x];
  }
}

}  // namespace braid
