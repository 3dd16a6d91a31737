// SPDX-License-Identifier: Apache-2.0
#include "combiners/weight_filter.h"

#include <algorithm>
#include <cmath>

#include "combiners/denoise/window.h"
#include "combiners/finite_float.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr int kRadius = 7;
constexpr int kBlock = 128;  // columns at a time
// Weights below 2^-80 are nothing, and their products would be subnormal numbers, which take hundreds of cycles.
constexpr float kLowestExponent = -80;
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

// out[x] = |image_p - image_q|² for pixels p from index `p` on and q from index `q` on.
void squaredDistances(const Rgb<float>& image, size_t p, size_t q, int count, float* __restrict out) {
  const float* __restrict rp = &image[0][p], * __restrict gp = &image[1][p], * __restrict bp = &image[2][p];
  const float* __restrict rq = &image[0][q], * __restrict gq = &image[1][q], * __restrict bq = &image[2][q];
  for (int x = 0; x < count; ++x) {
    const float r = rp[x] - rq[x], g = gp[x] - gq[x], b = bp[x] - bq[x];
    out[x] = r * r + g * g + b * b;
  }
}

// kappa(p, q) of `count` pixel pairs.
void kernelOfRow(const Guides& guides, size_t p, size_t q, float spatial, int count, float* __restrict out) {
  float distance[kBlock];
  squaredDistances(*guides.colour, p, q, count, distance);
  const float* __restrict vp = guides.variance->data.data() + p, * __restrict vq = guides.variance->data.data() + q;
  for (int x = 0; x < count; ++x) out[x] = spatial + exponentScale(kColour) * (distance[x] / (vp[x] + vq[x]));
  if (guides.albedo) {
    squaredDistances(*guides.albedo, p, q, count, distance);
    for (int x = 0; x < count; ++x) out[x] += exponentScale(kAlbedo) * distance[x];
  }
  if (guides.normal) {
    squaredDistances(*guides.normal, p, q, count, distance);
    for (int x = 0; x < count; ++x) out[x] += exponentScale(kNormal) * distance[x];
  }
  for (int x = 0; x < count; ++x) out[x] = exp2NonPositive(std::max(-out[x], kLowestExponent));
}

// Filters columns [x0, x0 + count) of row y. `sums` has room for all maps.
void filterBlock(const WeightMaps& raw, const Guides& guides, int step, int x0, int y, int count, float* sums,
                 WeightMaps& out) {
  const Plane<float>& shape = raw.planes[0];
  float norm[kBlock] = {}, kernel[kBlock];
  std::fill_n(sums, raw.planes.size() * kBlock, 0.0f);
  const int radius = kRadius / step * step;
  for (int dy = -std::min(radius, y / step * step); dy <= std::min(radius, shape.height - 1 - y); dy += step)
    for (int dx = -radius; dx <= radius; dx += step) {
      const int from = std::max(x0, -dx), to = std::min(x0 + count, shape.width - dx), n = to - from;
      if (n <= 0) continue;
      const size_t p = shape.index(from, y), q = shape.index(from + dx, y + dy);
      const auto spatial = static_cast<float>(dx * dx + dy * dy) * exponentScale(kSpatial);
      kernelOfRow(guides, p, q, spatial, n, kernel);
      float* normAt = norm + (from - x0);
      for (int x = 0; x < n; ++x) normAt[x] += kernel[x];
      for (size_t m = 0; m < raw.planes.size(); ++m) {
        float* __restrict sum = sums + m * kBlock + (from - x0);
        const float* __restrict weight = raw.planes[m].data.data() + q;
        for (int x = 0; x < n; ++x) sum[x] += kernel[x] * weight[x];
      }
    }
  for (size_t m = 0; m < raw.planes.size(); ++m)
    for (int x = 0; x < count; ++x) out.planes[m].at(x0 + x, y) = sums[m * kBlock + static_cast<size_t>(x)] / norm[x];
}

}  // namespace

WeightMaps filteredWeights(const WeightMaps& raw, const Estimate& guide, const Features* features, int step) {
  BRAID_ASSERT(step >= 1 && step <= kRadius);
  const Plane<float> variance = guideVariance(guide);
  Guides guides{&guide.mean, &variance, nullptr, nullptr};
  if (features && !features->albedo.mean.empty()) guides.albedo = &features->albedo.mean;
  if (features && !features->normal.mean.empty()) guides.normal = &features->normal.mean;
  WeightMaps out = raw;
  const int width = guide.mean.width();
  parallelRows(guide.mean.height(), [&](int y) {
    std::vector<float> sums(raw.planes.size() * kBlock);
    for (int x0 = 0; x0 < width; x0 += kBlock)
      runVectorised([&] { filterBlock(raw, guides, step, x0, y, std::min(kBlock, width - x0), sums.data(), out); });
  });
  return out;
}

}  // namespace braid
