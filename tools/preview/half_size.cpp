// SPDX-License-Identifier: Apache-2.0
#include "tools/preview/half_size.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

int halved(int size) { return (size + 1) / 2; }

// `variance`: of means of independent pixels.
Plane<float> halfSize(const Plane<float>& plane, bool variance = false) {
  if (plane.empty()) return {};
  Plane<float> out(halved(plane.width), halved(plane.height), kUnfilled);
  parallelRows(out.height, [&](int y) {
    for (int x = 0; x < out.width; ++x) {
      double sum = 0, count = 0;
      for (int v = 2 * y; v < std::min(plane.height, 2 * y + 2); ++v)
        for (int u = 2 * x; u < std::min(plane.width, 2 * x + 2); ++u, ++count)
          sum += static_cast<double>(plane.at(u, v));
      out.at(x, y) = static_cast<float>(sum / (variance ? count * count : count));
    }
  });
  return out;
}

Rgb<float> halfSize(const Rgb<float>& image, bool variance = false) {
  Rgb<float> out;
  for (size_t c = 0; c < 3; ++c) out[c] = halfSize(image[c], variance);
  return out;
}

Estimate halfSize(const Estimate& e) {
  Estimate out;
  static_cast<EstimateHead&>(out) = e;
  out.mean = halfSize(e.mean);
  out.variance = halfSize(e.variance, true);
  out.bias = halfSize(e.bias);
  out.biasVariance = halfSize(e.biasVariance, true);
  for (size_t h = 0; h < 2; ++h) {
    out.half[h] = halfSize(e.half[h]);
    out.biasHalf[h] = halfSize(e.biasHalf[h]);
  }
  return out;
}

// Where a pixel lies between two of the image of half the size.
struct Between {
  int first, second;
  float share;  // of the second
  Between(int at, int size) {
    const float place = 0.5f * (static_cast<float>(at) + 0.5f) - 0.5f, whole = std::floor(place);
    first = std::clamp(static_cast<int>(whole), 0, size - 1);
    second = std::clamp(static_cast<int>(whole) + 1, 0, size - 1);
    share = place - whole;
  }
};

}  // namespace

Estimates halfSize(const Estimates& estimates) {
  Estimates out;
  out.seed = estimates.seed;
  out.width = out.fullWidth = halved(estimates.width);
  out.height = out.fullHeight = halved(estimates.height);
  out.window = {0, 0, out.width, out.height};
  for (const Estimate& e : estimates.estimates) out.estimates.push_back(halfSize(e));
  if (!estimates.features) return out;
  out.features.emplace();
  forEachFeature(*estimates.features, *out.features, [](const auto& whole, auto& small) {
    small.mean = halfSize(whole.mean);
    small.variance = halfSize(whole.variance, true);
    for (size_t h = 0; h < 2; ++h) small.half[h] = halfSize(whole.half[h]);
  });
  return out;
}

Rgb<float> doubleSize(const Rgb<float>& image, int width, int height) {
  Rgb<float> out(width, height, kUnfilled);
  parallelRows(height, [&](int y) {
    const Between row(y, image.height());
    for (int x = 0; x < width; ++x) {
      const Between column(x, image.width());
      for (size_t c = 0; c < 3; ++c) {
        const Plane<float>& p = image[c];
        const auto along = [&](int v) {
          return std::lerp(p.at(column.first, v), p.at(column.second, v), column.share);
        };
        out[c].at(x, y) = std::lerp(along(row.first), along(row.second), row.share);
      }
    }
  });
  return out;
}

}  // namespace braid
