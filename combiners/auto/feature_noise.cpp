// SPDX-License-Identifier: Apache-2.0
#include "combiners/auto/feature_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "combiners/pixels/box_mean.h"
#include "renderer/core/parallel.h"
#include "renderer/core/vec.h"

namespace braid {

namespace {

constexpr float kHalfAveraged = 0.005f;    // squared difference of features that are averaged by half
constexpr float kNormals = 0.25f * 0.25f;  // what squared differences of normals count
constexpr float kNoisePasses = 2;
constexpr float kDark = 0.02f;   // of radiance in the units of the methods
constexpr float kAlike = 0.01f;  // squared differences by less do not tell directions apart

struct Direction {
  int x, y;
  float weight;  // of each of both neighbours; that of the pixel is 4
};
constexpr std::array<Direction, 4> kDirections{{{1, 0, 2}, {0, 1, 2}, {1, 1, 1}, {1, -1, 1}}};
constexpr float kCentre = 4;
using Differences = std::array<Plane<float>, kDirections.size()>;

// The nearest pixel of the plane.
size_t nearest(const Plane<float>& plane, int x, int y) {
  return plane.index(std::clamp(x, 0, plane.width - 1), std::clamp(y, 0, plane.height - 1));
}

// Of pixels where all rays miss nothing differs: what is seen there is the environment, without noise.
float squaredDifference(const Features& f, size_t i, size_t j) {
  const Plane<float>& depth = f.depth.mean;
  const bool seen[2] = {depth.empty() || depth[i] != 0, depth.empty() || depth[j] != 0};
  if (!seen[0] && !seen[1]) return 0;
  float albedo = 0, normal = 0;
  for (size_t c = 0; c < 3; ++c) {
    const auto albedoAt = [&](size_t k, bool s) { return s ? std::clamp(f.albedo.mean[c][k], 0.0f, 1.0f) : 0.0f; };
    albedo += sqr(albedoAt(i, seen[0]) - albedoAt(j, seen[1]));
    normal += sqr(f.normal.mean[c][i] - f.normal.mean[c][j]);
  }
  return albedo + kNormals * normal;
}

// d(k) of the header.
Differences differencesOf(const Features& f) {
  const Plane<float>& plane = f.normal.mean[0];
  Differences out;
  out.fill(Plane<float>(plane.width, plane.height, kUnfilled));
  parallelRows(plane.height, [&](int y) {
    for (int x = 0; x < plane.width; ++x) {
      const size_t i = plane.index(x, y);
      for (size_t k = 0; k < out.size(); ++k) {
        const auto [dx, dy, weight] = kDirections[k];
        const float sum = squaredDifference(f, i, nearest(plane, x + dx, y + dy)) +
                          squaredDifference(f, i, nearest(plane, x - dx, y - dy));
        out[k][i] = std::isfinite(sum) ? sum / 2 : 0.0f;
      }
    }
  });
  return out;
}

float least(const Differences& d, size_t i) { return std::min({d[0][i], d[1][i], d[2][i], d[3][i]}); }

Plane<float> varianceOfFeatures(const Features& f) {
  Plane<float> sum(f.albedo.variance.width(), f.albedo.variance.height(), 0.0f);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < sum.size(); ++i) {
      const float v = f.albedo.variance[c][i] + kNormals * f.normal.variance[c][i];
      sum[i] += std::isfinite(v) ? std::max(v, 0.0f) : 0.0f;
    }
  return boxMean<float>(sum, 1);
}

// Whether there is what tells noise from detail, of the size of the image.
bool tellsNoise(const Features& f, const Rgb<float>& image, uint64_t passes) {
  const auto fits = [&](const Rgb<float>& plane) { return plane.size() == image.size(); };
  return fits(f.albedo.mean) && fits(f.normal.mean) &&
         (passes < 2 || (fits(f.albedo.variance) && fits(f.normal.variance)));
}

// The share of every pixel that is averaged.
Plane<float> averagedShare(const Differences& d, const Features& f, uint64_t passes, const Plane<float>& own) {
  const Plane<float> noise = passes < 2 ? Plane<float>() : varianceOfFeatures(f);
  const float factor = kNoisePasses / static_cast<float>(passes);
  Plane<float> share(d[0].width, d[0].height, kUnfilled);
  for (size_t i = 0; i < share.size(); ++i) {
    const float m = noise.empty() ? least(d, i) : std::min(least(d, i), factor * noise[i]);
    share[i] = m / (m + kHalfAveraged) * (own.empty() ? 1.0f : std::clamp(own[i], 0.0f, 1.0f));
  }
  return share;
}

// The differences become weights of directions.
Differences directionWeights(Differences d) {
  for (Plane<float>& plane : d) plane = boxMean<float>(plane, 2);
  parallelChunks(d[0].size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float alike = least(d, i) + kAlike;
      for (size_t k = 0; k < d.size(); ++k) {
        const float ratio = alike / (d[k][i] + kAlike);
        d[k][i] = kDirections[k].weight * ratio * ratio * ratio;
      }
    }
  });
  return d;
}

// The mean of a pixel and its neighbours.
Spectrum meanAround(const Rgb<float>& image, const Differences& weights, int x, int y) {
  const size_t i = weights[0].index(x, y);
  Spectrum sum = kCentre * image.pixel(i);
  float total = kCentre;
  for (size_t k = 0; k < weights.size(); ++k) {
    const auto [dx, dy, weight] = kDirections[k];
    const size_t before = nearest(weights[0], x - dx, y - dy), after = nearest(weights[0], x + dx, y + dy);
    sum += weights[k][i] * (image.pixel(before) + image.pixel(after));
    total += 2 * weights[k][i];
  }
  return sum / total;
}

void averageBy(const Plane<float>& share, const Differences& weights, Rgb<float>& image) {
  const Rgb<float> before = image;
  parallelRows(share.height, [&](int y) {
    for (int x = 0; x < share.width; ++x) {
      const size_t i = share.index(x, y);
      if (!(share[i] > 0)) continue;
      const Spectrum value = before.pixel(i), change = share[i] * (meanAround(before, weights, x, y) - value);
      const float most = std::max({std::abs(change.x), std::abs(change.y), std::abs(change.z)}),
                  limit = std::max((value.x + value.y + value.z) / 3, kDark);
      const Spectrum averaged = value + (most > limit ? limit / most : 1) * change;
      if (isFinite(averaged)) image.set(i, averaged);
    }
  });
}

}  // namespace

void averageFeatureNoise(Estimate& image, const Features* features, uint64_t passes, const Plane<float>& own,
                         const std::atomic<bool>* cancel) {
  if (!features || (cancel && cancel->load())) return;
  if (!tellsNoise(*features, image.mean, passes)) return;
  Differences differences = differencesOf(*features);
  const Plane<float> share = averagedShare(differences, *features, passes, own);
  const Differences weights = directionWeights(std::move(differences));
  for (Rgb<float>* part : {&image.mean, &image.half[0], &image.half[1]})
    if (!part->empty()) averageBy(share, weights, *part);
}

}  // namespace braid
