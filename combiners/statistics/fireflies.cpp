// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/fireflies.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "combiners/pixels/channel_mean.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/mirror.h"

namespace braid {

namespace {

constexpr int kDeviationRadius = 7, kNeighbourRadius = 2;
constexpr double kDeviationRatio = 8, kSameSurface = 1.5, kQuarterShare = 0.3;
constexpr double kAlbedoDeviation = 0.25, kNormalDeviation = 0.15;

double brightness(const Rgb<float>& image, size_t i) {
  return (static_cast<double>(image[0][i]) + static_cast<double>(image[1][i]) + static_cast<double>(image[2][i])) / 3;
}

double squaredDistance(const Rgb<float>& image, size_t i, size_t j) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double d = static_cast<double>(image[c][i]) - static_cast<double>(image[c][j]);
    sum += d * d;
  }
  return sum;
}

// Pixels whose deviation stands out of their surroundings.
std::vector<char> candidates(const Rgb<float>& variance) {
  const Plane<float> deviation = channelMean(variance, [&](size_t i, size_t) {
    double v = 0;
    for (size_t c = 0; c < 3; ++c) v += static_cast<double>(variance[c][i]) / 3;
    return std::sqrt(v);
  });
  const Plane<float> around = mirrorBoxMean<float>(deviation, kDeviationRadius);
  std::vector<char> out(deviation.size());
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      out[i] = static_cast<double>(deviation[i]) > kDeviationRatio * static_cast<double>(around[i]);
  });
  return out;
}

// The brightness of what half of the samples show, the darker half.
class DarkHalf {
 public:
  DarkHalf(const Estimate& estimate, const GivenQuarters& quarters) : scale_(quarters.scale) {
    if (quarters.images && quarters.images->size() == 4) {
      for (const Rgb<float>& image : *quarters.images) parts_.push_back(&image);
    } else if (!estimate.half[0].empty() && !estimate.half[1].empty()) {
      parts_ = {&estimate.half[0], &estimate.half[1]};
      scale_ = 1;
    }
  }
  bool known() const { return !parts_.empty(); }
  double at(size_t i) const {
    std::array<double, 4> values{};
    for (size_t k = 0; k < parts_.size(); ++k) {
      const double value = scale_ * brightness(*parts_[k], i);
      values[k] = std::isfinite(value) ? value : 0;
    }
    if (parts_.size() == 2) return std::min(values[0], values[1]);
    std::sort(values.begin(), values.end());
    return 0.5 * (values[0] + values[1]);
  }

 private:
  double scale_;
  std::vector<const Rgb<float>*> parts_;  // quarters or halves
};

struct Neighbours {
  double weight = 0, brightest = 0;
  std::array<double, 3> mean{}, variance{};
};

Neighbours neighboursOf(const Rgb<float>& image, const Rgb<float>& variance, const std::vector<char>& candidate,
                        const Features* features, int x, int y) {
  Neighbours n;
  const size_t at = image[0].index(x, y);
  for (int v = std::max(0, y - kNeighbourRadius); v <= std::min(image.height() - 1, y + kNeighbourRadius); ++v)
    for (int u = std::max(0, x - kNeighbourRadius); u <= std::min(image.width() - 1, x + kNeighbourRadius); ++u) {
      const size_t other = image[0].index(u, v);
      if (candidate[other]) continue;
      double unlike = 0;
      if (features)
        unlike = squaredDistance(features->albedo.mean, at, other) / (2 * kAlbedoDeviation * kAlbedoDeviation) +
                 squaredDistance(features->normal.mean, at, other) / (2 * kNormalDeviation * kNormalDeviation);
      if (unlike < kSameSurface) n.brightest = std::max(n.brightest, brightness(image, other));
      const double distance = static_cast<double>((u - x) * (u - x) + (v - y) * (v - y));
      const double w = std::exp(-unlike - distance / 8);
      n.weight += w;
      for (size_t c = 0; c < 3; ++c) {
        n.mean[c] += w * static_cast<double>(image[c][other]);
        n.variance[c] += w * static_cast<double>(variance[c][other]);
      }
    }
  for (size_t c = 0; c < 3 && n.weight > 0; ++c) {
    n.mean[c] /= n.weight;
    n.variance[c] /= n.weight;
  }
  return n;
}

}  // namespace

std::vector<Firefly> findFireflies(const Estimate& estimate, const GivenQuarters& quarters, const Features* features) {
  const Rgb<float>&image = estimate.mean, &variance = estimate.variance;
  const DarkHalf darkHalf(estimate, quarters);
  std::vector<Firefly> fireflies;
  if (!darkHalf.known()) return fireflies;
  const std::vector<char> candidate = candidates(variance);
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) {
      const size_t i = image[0].index(x, y);
      if (!candidate[i]) continue;
      const Neighbours n = neighboursOf(image, variance, candidate, features, x, y);
      const double value = brightness(image, i);
      if (n.weight < 1e-6 || value <= n.brightest) continue;
      const double mean = (n.mean[0] + n.mean[1] + n.mean[2]) / 3;
      // On the rim of a lamp no neighbour is of the same surface, and the others may be brighter.
      if (value <= mean) continue;
      if (darkHalf.at(i) - mean >= kQuarterShare * (value - mean)) continue;
      Firefly firefly{i};
      for (int c = 0; c < 3; ++c) {
        firefly.value[c] = finiteFloat(n.mean[static_cast<size_t>(c)]);
        firefly.variance[c] = finiteFloat(n.variance[static_cast<size_t>(c)]);
      }
      fireflies.push_back(firefly);
    }
  return fireflies;
}

Estimate withoutFireflies(const Estimate& estimate, const GivenQuarters& quarters, const Features* features) {
  Estimate out = filterInput(estimate);
  const std::vector<Firefly> fireflies = findFireflies(out, quarters, features);
  for (Rgb<float>* image : {&out.mean, &out.half[0], &out.half[1]})
    if (!image->empty()) replaceValues(*image, fireflies);
  replaceVariances(out.variance, fireflies);
  return out;
}

void replaceValues(Rgb<float>& image, const std::vector<Firefly>& fireflies) {
  for (const Firefly& s : fireflies)
    for (size_t c = 0; c < 3; ++c) image[c][s.index] = s.value[static_cast<int>(c)];
}

void replaceVariances(Rgb<float>& variance, const std::vector<Firefly>& fireflies) {
  for (const Firefly& s : fireflies)
    for (size_t c = 0; c < 3; ++c) variance[c][s.index] = s.variance[static_cast<int>(c)];
}

}  // namespace braid
