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
    out[x] = exp2NonPositive(std::max(-e, kLowestExponent));
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
