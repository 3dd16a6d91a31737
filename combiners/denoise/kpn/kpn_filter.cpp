// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/kpn/kpn_filter.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/window.h"
#include "renderer/core/parallel.h"
#include "renderer/core/vec.h"
#include "renderer/core/vectorised.h"

namespace braid {

namespace {

constexpr int kRadius = 2;
constexpr float kTiny = 1e-12f, kMostExcess = 1e4f, kLeastLogit = -12;

int halved(int n) { return (n + 1) / 2; }

// One resolution of the image.
struct Scale {
  Rgb<float> image;
  Plane<float> variance;           // of its luminance
  Plane<float> weight;             // of a pixel against its neighbours
  Plane<float> brightness, noise;  // the mean luminance of 3x3 pixels and its variance
};

void describe(Scale& s) {
  Plane<float> light(s.image.width(), s.image.height(), kUnfilled);
  parallelChunks(light.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) light[i] = luminance(Spectrum(s.image[0][i], s.image[1][i], s.image[2][i]));
  });
  s.brightness = boxMean<float>(light, 1);
  s.noise = boxMean<float>(s.variance, 1);
  for (float& v : s.noise.data) v /= 9;
}

// Means over 2x2 pixels by their weights; at the borders over those that there are.
Scale halfOf(const Scale& fine) {
  const int w = fine.weight.width, h = fine.weight.height;
  Scale out{{halved(w), halved(h)}, {halved(w), halved(h)}, {halved(w), halved(h)}, {}, {}};
  parallelRows(out.weight.height, [&](int y) {
    for (int x = 0; x < out.weight.width; ++x) {
      float sum = 0, variance = 0, rgb[3] = {0, 0, 0};
      int count = 0;
      for (int v = 2 * y; v < std::min(h, 2 * y + 2); ++v)
        for (int u = 2 * x; u < std::min(w, 2 * x + 2); ++u, ++count) {
          const size_t i = fine.weight.index(u, v);
          const float q = fine.weight[i];
          sum += q;
          variance += q * q * fine.variance[i];
          for (size_t c = 0; c < 3; ++c) rgb[c] += q * fine.image[c][i];
        }
      const size_t to = out.weight.index(x, y);
      out.weight[to] = sum / static_cast<float>(count);
      out.variance[to] = variance / (sum * sum);
      for (size_t c = 0; c < 3; ++c) out.image[c][to] = rgb[c] / sum;
    }
  });
  return out;
}

using Features = std::vector<Plane<float>>;

// Sums over the kernels of a row.
struct KernelRow {
  std::vector<float> total, red, green, blue, distance;
  explicit KernelRow(size_t width) : total(width), red(width), green(width), blue(width), distance(width) {}
};

void distanceRow(const float* __restrict a, const float* __restrict b, int count, float* __restrict sum) {
  for (int x = 0; x < count; ++x) {
    const float d = a[x] - b[x];
    sum[x] += d * d;
  }
}

struct Test {
  float steepness, tolerance;
};

// Adds a neighbour to the pixels [first, first + count) of a row, `p` and `q` being their indices.
struct TapRow {
  const Scale& s;
  size_t p, q;
  int first, count;
  Test test;

  void addTo(KernelRow& row) const {
    const float* __restrict bp = &s.brightness[p], * __restrict bq = &s.brightness[q];
    const float* __restrict np = &s.noise[p], * __restrict nq = &s.noise[q];
    const float* __restrict wq = &s.weight[q];
    const float* __restrict r = &s.image[0][q], * __restrict g = &s.image[1][q], * __restrict b = &s.image[2][q];
    const float* __restrict distance = row.distance.data();
    float* __restrict total = row.total.data() + first, * __restrict red = row.red.data() + first;
    float* __restrict green = row.green.data() + first, * __restrict blue = row.blue.data() + first;
    for (int x = 0; x < count; ++x) {
      const float difference = bp[x] - bq[x];
      const float z = difference * difference / (np[x] + nq[x] + kTiny);
      const float excess = std::min(std::max(z - test.tolerance, 0.0f), kMostExcess);
      const float exponent = -kLog2E * (distance[x] + test.steepness * excess);
      const float w = wq[x] * exp2NonPositive(std::max(exponent, -100.0f));
      total[x] += w;
      red[x] += w * r[x];
      green[x] += w * g[x];
      blue[x] += w * b[x];
    }
  }
};

void filterRow(const Scale& s, const Features& features, size_t count, const Test& test, int y, Rgb<float>& out) {
  const int width = out.width(), height = out.height();
  KernelRow row(static_cast<size_t>(width));
  for (int dy = -kRadius; dy <= kRadius; ++dy)
    for (int dx = -kRadius; dx <= kRadius; ++dx) {
      const int first = std::max(0, -dx), last = std::min(width, width - dx);
      if (y + dy < 0 || y + dy >= height || first >= last) continue;
      const TapRow tap{s, s.weight.index(first, y), s.weight.index(first + dx, y + dy), first, last - first, test};
      std::fill(row.distance.begin(), row.distance.end(), 0.0f);
      for (size_t k = 0; k < count; ++k)
        distanceRow(&features[k][tap.p], &features[k][tap.q], tap.count, row.distance.data());
      tap.addTo(row);
    }
  const size_t at = s.weight.index(0, y);
  for (size_t x = 0; x < static_cast<size_t>(width); ++x) {
    out[0][at + x] = row.red[x] / row.total[x];
    out[1][at + x] = row.green[x] / row.total[x];
    out[2][at + x] = row.blue[x] / row.total[x];
  }
}

// A coarse pixel near a fine one, and its share by distance.
struct Near {
  int x, y;
  float share;
};

// Four of them, in the order of the formula; beyond the border the last pixel stands again.
std::array<Near, 4> nearest(int x, int y, int width, int height) {
  const int cx = x / 2, cy = y / 2;
  const int nx = std::clamp(cx + (x % 2 ? 1 : -1), 0, width - 1), ny = std::clamp(cy + (y % 2 ? 1 : -1), 0, height - 1);
  return {Near{cx, cy, 9.0f / 16}, Near{cx, ny, 3.0f / 16}, Near{nx, cy, 3.0f / 16}, Near{nx, ny, 1.0f / 16}};
}

Plane<float> halfMean(const Plane<float>& fine) {
  Plane<float> out(halved(fine.width), halved(fine.height), kUnfilled);
  parallelRows(out.height, [&](int y) {
    for (int x = 0; x < out.width; ++x) {
      float sum = 0;
      int count = 0;
      for (int v = 2 * y; v < std::min(fine.height, 2 * y + 2); ++v)
        for (int u = 2 * x; u < std::min(fine.width, 2 * x + 2); ++u, ++count) sum += fine.at(u, v);
      out.at(x, y) = sum / static_cast<float>(count);
    }
  });
  return out;
}

// Blends the next coarser image into the filtered one.
struct Join {
  const Scale& scale;
  const Features& features;  // then the gate, the last of them
  size_t count;
  Test test;
  std::vector<Plane<float>> guide;  // their means over 2x2

  Join(const Scale& s, const Features& f, size_t n, const Test& t) : scale(s), features(f), count(n), test(t) {
    for (size_t k = 0; k < n; ++k) guide.push_back(halfMean(f[k]));
  }
  void row(int y, const Rgb<float>& coarse, Rgb<float>& image) const;
};

void Join::row(int y, const Rgb<float>& coarse, Rgb<float>& image) const {
  for (int x = 0; x < image.width(); ++x) {
    const size_t i = scale.weight.index(x, y);
    const std::array<Near, 4> near = nearest(x, y, coarse.width(), coarse.height());
    std::array<float, 4> distance{};
    for (size_t j = 0; j < 4; ++j)
      for (size_t k = 0; k < count; ++k) {
        const float d = features[k][i] - guide[k].at(near[j].x, near[j].y);
        distance[j] += d * d;
      }
    const float least = *std::min_element(distance.begin(), distance.end());
    float total = 0, rgb[3] = {0, 0, 0};
    for (size_t j = 0; j < 4; ++j) {
      const float w = near[j].share * exp2NonPositive(std::max(kLog2E * (least - distance[j]), -100.0f));
      total += w;
      for (size_t c = 0; c < 3; ++c) rgb[c] += w * coarse[c].at(near[j].x, near[j].y);
    }
    for (float& v : rgb) v /= total;
    const float difference = scale.brightness[i] - luminance(Spectrum(rgb[0], rgb[1], rgb[2]));
    const float z = difference * difference / (scale.noise[i] + kTiny);
    const float excess = std::min(std::max(z - test.tolerance, 0.0f), kMostExcess);
    const float open = exp2NonPositive(std::max(-kLog2E * test.steepness * excess, -100.0f));
    const float gate = open / (1 + std::exp(-std::clamp(features.back()[i], -60.0f, 60.0f)));
    for (size_t c = 0; c < 3; ++c) image[c][i] += gate * (rgb[c] - image[c][i]);
  }
}

size_t featuresOf(int level) { return level == 0 ? kKpnFineFeatures : kKpnCoarseFeatures; }

Scale finest(const Rgb<float>& irradiance, const Plane<float>& variance, const Plane<float>& logit) {
  Scale s{irradiance, variance, Plane<float>(variance.width, variance.height, kUnfilled), {}, {}};
  parallelChunks(logit.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) s.weight[i] = 1 / (1 + std::exp(-std::clamp(logit[i], kLeastLogit, 60.0f)));
  });
  return s;
}

}  // namespace

KpnFeatures kpnFeatures(int width, int height) {
  KpnFeatures out;
  out.level[0].assign(kKpnFineOutputs, Plane<float>(width, height, kUnfilled));
  for (size_t l = 1; l < kKpnLevels; ++l)
    out.level[l].assign(kKpnCoarseOutputs, Plane<float>(halved(width), halved(height), kUnfilled));
  return out;
}

void shrinkToLevels(KpnFeatures& features) {
  for (size_t l = 2; l < kKpnLevels; ++l)
    for (Plane<float>& plane : features.level[l])
      for (size_t k = 1; k < l; ++k) plane = halfMean(plane);
}

Rgb<float> kpnFiltered(const Rgb<float>& irradiance, const Plane<float>& variance, const KpnFeatures& features,
                       const KpnTests& tests) {
  std::array<Scale, kKpnLevels> scales;
  scales[0] = finest(irradiance, variance, features.level[0][kKpnFineFeatures]);
  for (size_t l = 1; l < kKpnLevels; ++l) scales[l] = halfOf(scales[l - 1]);
  Rgb<float> below;
  for (size_t l = kKpnLevels; l-- > 0;) {
    Scale& scale = scales[l];
    describe(scale);
    const Features& f = features.level[l];
    const size_t count = featuresOf(static_cast<int>(l));
    Rgb<float> image(scale.weight.width, scale.weight.height, kUnfilled);
    const Test kernels{tests.steepness[l], tests.tolerance[l]};
    parallelRows(image.height(), [&](int y) { runVectorised([&] { filterRow(scale, f, count, kernels, y, image); }); });
    if (!below.empty()) {
      const Join join(scale, f, count, {tests.gateSteepness[l], tests.gateTolerance[l]});
      parallelRows(image.height(), [&](int y) { join.row(y, below, image); });
    }
    below = std::move(image);
    scale = {};
  }
  return below;
}

}  // namespace braid
