// SPDX-License-Identifier: Apache-2.0
#include "combiners/exposure.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kTile = 16;
constexpr double kMiddleGrey = 0.18;
constexpr double kDarkest = 1e-8;  // of the brightest tile
constexpr float kLargest = 1e9f;   // of normalised colours and of features

double meanLuminance(const Rgb<float>& image, int x0, int y0, int x1, int y1) {
  double sum = 0;
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) {
      const size_t i = image[0].index(x, y);
      const double l = 0.2126 * static_cast<double>(image[0][i]) + 0.7152 * static_cast<double>(image[1][i]) +
                       0.0722 * static_cast<double>(image[2][i]);
      if (std::isfinite(l)) sum += l;
    }
  return sum / (static_cast<double>(x1 - x0) * (y1 - y0));
}

// How many values were replaced.
uint64_t clean(Plane<float>& plane, float lowest) {
  return parallelSum<uint64_t>(plane.size(), kPixelChunk, 0, [&](size_t begin, size_t end) {
    uint64_t count = 0;
    for (size_t i = begin; i < end; ++i)
      if (!std::isfinite(plane[i]) || plane[i] < lowest) {
        plane[i] = 0;
        ++count;
      }
    return count;
  });
}

constexpr float kAnyFinite = std::numeric_limits<float>::lowest();

void cleanValues(Plane<float>& plane, SanitiseReport& report) { report.nonFinite += clean(plane, kAnyFinite); }
void cleanVariance(Plane<float>& plane, SanitiseReport& report) {
  cleanValues(plane, report);
  report.negativeVariance += clean(plane, 0.0f);
}
void cleanValues(Rgb<float>& image, SanitiseReport& report) {
  for (Plane<float>& p : image.channel) cleanValues(p, report);
}
void cleanVariance(Rgb<float>& image, SanitiseReport& report) {
  for (Plane<float>& p : image.channel) cleanVariance(p, report);
}

template <class P>
void cleanFeature(FeaturePlanes<P>& f, SanitiseReport& report) {
  cleanValues(f.mean, report);
  cleanValues(f.half[0], report);
  cleanValues(f.half[1], report);
  cleanVariance(f.variance, report);
}

// In double: k² of scenes in physical units is out of the range of floats sooner than the product. What leaves the
// range stays at its end.
void multiply(Plane<float>& plane, double k) {
  constexpr auto kEnd = static_cast<double>(std::numeric_limits<float>::max());
  parallelChunks(plane.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      plane[i] = static_cast<float>(std::clamp(static_cast<double>(plane[i]) * k, -kEnd, kEnd));
  });
}
void multiply(Rgb<float>& image, double k) {
  for (Plane<float>& p : image.channel) multiply(p, k);
}

uint64_t limit(Plane<float>& p, float largest) {
  return parallelSum<uint64_t>(p.size(), kPixelChunk, 0, [&](size_t begin, size_t end) {
    uint64_t count = 0;
    for (size_t i = begin; i < end; ++i)
      if (std::fabs(p[i]) > largest) {
        p[i] = std::copysign(largest, p[i]);
        ++count;
      }
    return count;
  });
}
uint64_t limit(Rgb<float>& image, float largest) {
  uint64_t moved = 0;
  for (Plane<float>& p : image.channel) moved += limit(p, largest);
  return moved;
}
template <class P>
uint64_t limitFeature(FeaturePlanes<P>& f) {
  return limit(f.mean, kLargest) + limit(f.half[0], kLargest) + limit(f.half[1], kLargest) +
         limit(f.variance, kLargest * kLargest);
}

SanitiseReport operator+(const SanitiseReport& a, const SanitiseReport& b) {
  return {a.nonFinite + b.nonFinite, a.negativeVariance + b.negativeVariance, a.outOfRange + b.outOfRange};
}

}  // namespace

double exposureScale(const Rgb<float>& image) {
  std::vector<double> tiles;
  const int columns = (image.width() + kTile - 1) / kTile, rows = (image.height() + kTile - 1) / kTile;
  // Tiles of nearly equal size: none is a sliver at the border.
  const auto cut = [](int i, int count, int size) {
    return static_cast<int>(static_cast<int64_t>(i) * size / std::max(count, 1));
  };
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i)
      tiles.push_back(meanLuminance(image, cut(i, columns, image.width()), cut(j, rows, image.height()),
                                    cut(i + 1, columns, image.width()), cut(j + 1, rows, image.height())));
  const double brightest = tiles.empty() ? 0 : *std::max_element(tiles.begin(), tiles.end());
  double sum = 0;
  int count = 0;
  for (const double l : tiles)
    if (l > 0 && l > kDarkest * brightest) {
      sum += std::log2(l);
      ++count;
    }
  return count > 0 ? kMiddleGrey / std::exp2(sum / count) : 1.0;
}

SanitiseReport sanitise(Estimate& e) {
  SanitiseReport report;
  for (Rgb<float>* image : {&e.mean, &e.half[0], &e.half[1], &e.bias}) cleanValues(*image, report);
  for (Rgb<float>& q : e.quarter) cleanValues(q, report);
  cleanVariance(e.variance, report);
  cleanVariance(e.biasVariance, report);
  return report;
}

SanitiseReport sanitise(Estimates& all) {
  SanitiseReport report;
  for (Estimate& e : all.estimates) report = report + sanitise(e);
  for (auto& [name, checkpoints] : all.history)
    for (Checkpoint& c : checkpoints) {
      cleanVariance(c.variance, report);
      for (Rgb<float>* image : {&c.mean, &c.half[0], &c.half[1]}) cleanValues(*image, report);
    }
  if (all.features) {
    cleanFeature(all.features->albedo, report);
    cleanFeature(all.features->normal, report);
    cleanFeature(all.features->depth, report);
    cleanFeature(all.features->visibility, report);
  }
  return report;
}

uint64_t limitRange(Estimates& all) {
  uint64_t moved = 0;
  for (Estimate& e : all.estimates) {
    for (Rgb<float>* image : {&e.mean, &e.half[0], &e.half[1], &e.bias}) moved += limit(*image, kLargest);
    for (Rgb<float>& q : e.quarter) moved += limit(q, kLargest);
    for (Rgb<float>* variance : {&e.variance, &e.biasVariance}) moved += limit(*variance, kLargest * kLargest);
  }
  for (auto& [name, checkpoints] : all.history)
    for (Checkpoint& c : checkpoints) {
      moved += limit(c.variance, kLargest * kLargest);
      for (Rgb<float>* image : {&c.mean, &c.half[0], &c.half[1]}) moved += limit(*image, kLargest);
    }
  if (all.features)
    moved += limitFeature(all.features->albedo) + limitFeature(all.features->normal) +
             limitFeature(all.features->depth) + limitFeature(all.features->visibility);
  return moved;
}

void scaleExposure(Estimate& e, double k) {
  for (Rgb<float>* image : {&e.mean, &e.half[0], &e.half[1], &e.bias}) multiply(*image, k);
  for (Rgb<float>& q : e.quarter) multiply(q, k);
  for (Rgb<float>* variance : {&e.variance, &e.biasVariance}) multiply(*variance, k * k);
}

void scaleExposure(Estimates& all, double k) {
  for (Estimate& e : all.estimates) scaleExposure(e, k);
  for (auto& [name, checkpoints] : all.history)
    for (Checkpoint& c : checkpoints) {
      multiply(c.variance, k * k);
      for (Rgb<float>* image : {&c.mean, &c.half[0], &c.half[1]}) multiply(*image, k);
    }
}

void scaleExposure(MethodResult& result, double k) {
  scaleExposure(result.image, k);
  multiply(result.error, k * k);
}

}  // namespace braid
