// SPDX-License-Identifier: Apache-2.0
#include "combiners/spatial_variance.h"

#include <algorithm>
#include <cmath>

#include "combiners/box_mean.h"
#include "renderer/core/hash.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kRadius = 4;
constexpr float kAlbedoFloor = 0.01f;
// Of second differences of features: what is more is an edge.
constexpr float kNormalEdge = 0.1f, kAlbedoEdge = 0.05f, kDepthEdge = 0.05f;
// (E √|r|)⁴ of a normal variate r of variance 1, times what the least of four such means over a window has less.
constexpr float kRootMoment = 0.4570f * 0.90f;
// A pixel whose squared difference exceeds the variance around it so many times stands out.
constexpr float kStandsOut = 16;
constexpr int kStep[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};

// x0 - (x1 + x2) / 2, of variance 1.5 times that of the pixels.
float secondDifference(const Plane<float>& p, size_t i, ptrdiff_t step) {
  const size_t a = i - static_cast<size_t>(step), b = i + static_cast<size_t>(step);
  return p[i] - 0.5f * p[a] - 0.5f * p[b];
}

float squaredDifference(const Rgb<float>& image, size_t i, ptrdiff_t step) {
  float sum = 0;
  for (size_t c = 0; c < 3; ++c) sum += sqr(secondDifference(image[c], i, step));
  return sum;
}

// 1 for the pixels whose difference in a direction lies within the image and on one surface.
Plane<float> usable(int width, int height, const Features* f, const int (&step)[2]) {
  Plane<float> out(width, height);
  const ptrdiff_t offset = static_cast<ptrdiff_t>(step[1]) * width + step[0];
  parallelRows(height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const bool inside =
          x >= step[0] && x + step[0] < width && y >= std::abs(step[1]) && y + std::abs(step[1]) < height;
      if (!inside) continue;
      const size_t i = out.index(x, y);
      const bool edge =
          f && (squaredDifference(f->normal.mean, i, offset) > kNormalEdge ||
                squaredDifference(f->albedo.mean, i, offset) > kAlbedoEdge ||
                std::abs(secondDifference(f->depth.mean, i, offset)) > kDepthEdge * std::abs(f->depth.mean[i]));
      out[i] = edge ? 0.0f : 1.0f;
    }
  });
  return out;
}

// The image without the colours of surfaces, as far as they are known.
Plane<float> demodulated(const Plane<float>& image, const Plane<float>* albedo) {
  Plane<float> out = image;
  if (!albedo) return out;
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] /= std::max(0.0f, (*albedo)[i]) + kAlbedoFloor;
  });
  return out;
}

}  // namespace

Rgb<float> spatialVariance(const Rgb<float>& image, const Features* features) {
  const int width = image.width(), height = image.height();
  const bool hasAlbedo = features && std::any_of(features->albedo.mean[0].data.begin(),
                                                 features->albedo.mean[0].data.end(), [](float a) { return a > 0; });
  Plane<float> use[4], share[4];
  for (size_t d = 0; d < 4; ++d) {
    use[d] = usable(width, height, features, kStep[d]);
    share[d] = boxMean<float>(use[d], kRadius);
  }
  Rgb<float> variance(width, height, kInfinity);
  for (size_t c = 0; c < 3; ++c) {
    const Plane<float> x = demodulated(image[c], hasAlbedo ? &features->albedo.mean[c] : nullptr);
    Plane<float>& out = variance[c];
    Plane<float> own(width, height, kInfinity);
    for (size_t d = 0; d < 4; ++d) {
      const ptrdiff_t step = static_cast<ptrdiff_t>(kStep[d][1]) * width + kStep[d][0];
      Plane<float> roots(width, height);
      parallelChunks(roots.size(), kPixelChunk, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
          if (use[d][i] == 0) continue;
          const float r = std::abs(secondDifference(x, i, step));
          roots[i] = std::sqrt(r);
          own[i] = std::min(own[i], sqr(r) / 1.5f);
        }
      });
      const Plane<float> mean = boxMean<float>(roots, kRadius);
      parallelChunks(roots.size(), kPixelChunk, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i)
          if (share[d][i] > 0.1f) out[i] = std::min(out[i], sqr(sqr(mean[i] / share[d][i])) / (1.5f * kRootMoment));
      });
    }
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        float v = out[i] < kInfinity ? out[i] : own[i] < kInfinity ? own[i] : 0.0f;
        if (own[i] < kInfinity && own[i] > kStandsOut * v) v = own[i];
        const float scale = hasAlbedo ? std::max(0.0f, features->albedo.mean[c][i]) + kAlbedoFloor : 1.0f;
        v *= sqr(scale);
        out[i] = std::isfinite(v) ? v : 0.0f;
      }
    });
  }
  return variance;
}

void makeHalves(Estimate& e, uint64_t seed) {
  const int width = e.mean.width(), height = e.mean.height();
  for (Rgb<float>& half : e.half) half = Rgb<float>(width, height, kUnfilled);
  parallelChunks(e.mean.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const uint64_t key = hashCombine(hashCombine(0x68616c766573, seed), i);
      // Box and Muller 1958.
      const double u = (static_cast<double>(mix64(key) >> 11) + 0.5) * 0x1p-53,
                   v = static_cast<double>(mix64(key + 1) >> 11) * 0x1p-53;
      const double normal = std::sqrt(-2 * std::log(u)) * std::cos(2 * static_cast<double>(kPi) * v);
      for (size_t c = 0; c < 3; ++c) {
        const auto noise =
            static_cast<float>(normal * std::sqrt(static_cast<double>(std::max(0.0f, e.variance[c][i]))));
        e.half[0][c][i] = e.mean[c][i] + noise;
        e.half[1][c][i] = e.mean[c][i] - noise;
      }
    }
  });
}

}  // namespace braid
