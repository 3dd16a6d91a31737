// SPDX-License-Identifier: Apache-2.0
#include "combiners/uncorrelated/uncorrelated_noise.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "combiners/pixels/finite_float.h"
#include "combiners/shrinkage/shrinkage.h"
#include "renderer/core/box_sum.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

// The square of a mean in units of its variance from which on it is that of several strong samples: k equal ones of
// many make k, and three are enough (combiners/EXPERIMENTS.md, Sharing out fireflies).
constexpr double kEstablished = 2.9;
// Neighbours of the eight that have to be as uncertain, within the factor, for a strong sample to be no firefly.
constexpr int kFellows = 3;
constexpr float kFellowFactor = 16;
constexpr float kStrong = 100;  // a variance in units of that around
constexpr float kKnown = 0.1f;  // of a mean: the other image has met the pixel's light as well
constexpr int kShareRadius = 31;

// Whether the variance at pixel (x, y) is also that of its neighbourhood.
bool hasFellows(const Plane<float>& variance, int x, int y) {
  int fellows = 0;
  for (int v = std::max(0, y - 1); v <= std::min(variance.height - 1, y + 1); ++v)
    for (int u = std::max(0, x - 1); u <= std::min(variance.width - 1, x + 1); ++u)
      if ((u != x || v != y) && kFellowFactor * variance.at(u, v) >= variance.at(x, y)) ++fellows;
  return fellows >= kFellows;
}

// Whether the variance at pixel (x, y) is to be believed: that of several strong samples, or of a place of such.
bool isEstablished(const Plane<float>& mean, const Plane<float>& variance, int x, int y) {
  return kEstablished * static_cast<double>(variance.at(x, y)) <= sqr(static_cast<double>(mean.at(x, y))) ||
         hasFellows(variance, x, y);
}

struct Pixel {
  int x, y;
};

std::vector<Pixel> lonePixels(const Plane<float>& mean, const Plane<float>& variance, const Plane<float>& around,
                              const Plane<float>& other) {
  std::vector<std::vector<Pixel>> ofRow(static_cast<size_t>(mean.height));
  parallelRows(mean.height, [&](int y) {
    for (int x = 0; x < mean.width; ++x)
      if (variance.at(x, y) > kStrong * around.at(x, y) && other.at(x, y) < kKnown * mean.at(x, y) &&
          !isEstablished(mean, variance, x, y))
        ofRow[static_cast<size_t>(y)].push_back({x, y});
  });
  std::vector<Pixel> lone;
  for (const std::vector<Pixel>& row : ofRow) lone.insert(lone.end(), row.begin(), row.end());
  return lone;
}

// Of the pixels [0, size), how many a window about x holds.
int windowSize(int x, int size) { return std::min(size - 1, x + kShareRadius) - std::max(0, x - kShareRadius) + 1; }

// Takes the pixels from `other`. Returns what they had more, shared out.
Plane<float> takenOut(const std::vector<Pixel>& pixels, const Plane<float>& other, Plane<float>& plane) {
  Plane<float> shares(plane.width, plane.height);
  for (const auto& [x, y] : pixels) {
    shares.at(x, y) = (plane.at(x, y) - other.at(x, y)) /
                      static_cast<float>(windowSize(x, plane.width) * windowSize(y, plane.height));
    plane.at(x, y) = other.at(x, y);
  }
  return finishedBoxSum<float>(shares, kShareRadius, WindowBorder::Clamped,
                               [](double sum, int /*x*/, int /*y*/) { return sum; });
}

Estimate imagesOf(const Estimate& of) {
  Estimate out;
  static_cast<EstimateHead&>(out) = of;
  out.mean = of.mean;
  for (size_t h = 0; h < 2; ++h) out.half[h] = of.half[h];
  out.quarter = of.quarter;
  out.variance = of.variance;
  return out;
}

}  // namespace

Rgb<float> noiseLevels(const Rgb<float>& mean, const Rgb<float>& variance) {
  Rgb<float> out(mean.width(), mean.height(), kUnfilled);
  for (size_t c = 0; c < 3; ++c) {
    const Plane<float> around = usualVariance(variance[c]);
    parallelRows(out.height(), [&](int y) {
      for (int x = 0; x < out.width(); ++x) {
        const size_t i = out[c].index(x, y);
        out[c][i] = isEstablished(mean[c], variance[c], x, y) ? std::max(variance[c][i], around[i]) : around[i];
      }
    });
  }
  return out;
}

Rgb<float> differenceNoiseLevels(const Estimate& y, const Estimate& z) {
  Rgb<float> out;
  for (const Estimate* image : {&y, &z}) {
    if (image->variance.empty()) continue;
    Rgb<float> levels = noiseLevels(image->mean, image->variance);
    for (size_t c = 0; c < 3 && !out.empty(); ++c)
      parallelChunks(levels.size(), kPixelChunk, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) levels[c][i] = finiteFloat(levels[c][i] + out[c][i]);
      });
    out = std::move(levels);
  }
  return out;
}

std::optional<SharedOut> takeFirefliesOut(const Estimate& image, const Rgb<float>& other) {
  std::optional<SharedOut> out;
  for (size_t c = 0; c < 3; ++c) {
    const Plane<float> around = usualVariance(image.variance[c]);
    const std::vector<Pixel> lone = lonePixels(image.mean[c], image.variance[c], around, other[c]);
    if (lone.empty()) continue;
    if (!out) {
      out.emplace();
      out->image = imagesOf(image);
      out->mean = out->half[0] = out->half[1] = Rgb<float>(other.width(), other.height());
    }
    out->mean[c] = takenOut(lone, other[c], out->image.mean[c]);
    for (size_t h = 0; h < 2; ++h) out->half[h][c] = takenOut(lone, other[c], out->image.half[h][c]);
    for (Rgb<float>& quarter : out->image.quarter)
      for (const auto& [x, y] : lone) quarter[c].at(x, y) = other[c].at(x, y);
    for (const auto& [x, y] : lone) out->image.variance[c].at(x, y) = around.at(x, y);
  }
  return out;
}

}  // namespace braid
