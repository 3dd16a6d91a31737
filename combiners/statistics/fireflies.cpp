// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/fireflies.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "combiners/pixels/channel_mean.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/likeness.h"
#include "combiners/pixels/mirror.h"

namespace braid {

namespace {

constexpr int kDeviationRadius = 7, kNeighbourRadius = 2;
constexpr double kDeviationRatio = 8, kSameSurface = 1.5, kQuarterShare = 0.3;
constexpr int kCommonRadius = 20;
// combiners/EXPERIMENTS.md, Fireflies that are the light, and Fireflies that judge
constexpr double kCommon = 12, kCommonToJudge = 3, kLike = 0.4;

double brightness(const Rgb<float>& image, size_t i) {
  return (static_cast<double>(image[0][i]) + static_cast<double>(image[1][i]) + static_cast<double>(image[2][i])) / 3;
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
  double weight = 0, most = 0, brightest = 0;  // most: what the weight would be if all were alike
  double likeness() const { return weight / most; }
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
      const double unlike = features ? unlikeness(*features, at, other) : 0;
      if (unlike < kSameSurface) n.brightest = std::max(n.brightest, brightness(image, other));
      const double distance = static_cast<double>((u - x) * (u - x) + (v - y) * (v - y));
      const double nearness = std::exp(-distance / 8), w = std::exp(-unlike) * nearness;
      n.most += nearness;
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

// Keeps of every firefly with like neighbours 1 - kCommon / K, or 1 - kCommonToJudge / K, where K fireflies of the same
// light, or as many as their light amounts to, lie in the window about it. `excess`: what these are brighter than their
// neighbours, 0 elsewhere.
void keepCommon(const Plane<float>& excess, std::vector<Firefly>& fireflies) {
  Plane<float> squares = excess;
  for (float& e : squares.data) e *= e;
  const Plane<float> mean = mirrorBoxMean<float>(excess, kCommonRadius);
  const Plane<float> meanSquare = mirrorBoxMean<float>(squares, kCommonRadius);
  constexpr double kPixels = (2 * kCommonRadius + 1) * (2 * kCommonRadius + 1);
  for (Firefly& s : fireflies) {
    if (!(excess[s.index] > 0)) continue;
    const double sum = kPixels * static_cast<double>(mean[s.index]);
    const double sumOfSquares = kPixels * static_cast<double>(meanSquare[s.index]);
    const auto kept = [&](double common) { return std::max(0.0, 1 - common * sumOfSquares / (sum * sum)); };
    s.kept = static_cast<float>(kept(kCommon));
    s.keptByJudge = static_cast<float>(kept(kCommonToJudge));
  }
}

// Also where the value is infinite.
float drawn(float value, float to, float kept) { return kept > 0 ? to + kept * (value - to) : to; }

}  // namespace

std::vector<Firefly> findFireflies(const Estimate& estimate, const GivenQuarters& quarters, const Features* features) {
  const Rgb<float>&image = estimate.mean, &variance = estimate.variance;
  const DarkHalf darkHalf(estimate, quarters);
  std::vector<Firefly> fireflies;
  if (!darkHalf.known()) return fireflies;
  const std::vector<char> candidate = candidates(variance);
  Plane<float> excess(image.width(), image.height(), 0.0f);
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
      if (features && n.likeness() > kLike) excess[i] = finiteFloat(value - mean);
      for (int c = 0; c < 3; ++c) {
        firefly.value[c] = finiteFloat(n.mean[static_cast<size_t>(c)]);
        firefly.variance[c] = finiteFloat(n.variance[static_cast<size_t>(c)]);
      }
      fireflies.push_back(firefly);
    }
  keepCommon(excess, fireflies);
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

std::vector<PixelValues> removePixels(Estimate& estimate, const std::vector<Firefly>& fireflies) {
  std::vector<PixelValues> before;
  for (const Firefly& s : fireflies) {
    PixelValues& pixel = before.emplace_back();
    pixel.index = s.index;
    for (int c = 0; c < 3; ++c) {
      const auto channel = static_cast<size_t>(c);
      pixel.mean[c] = estimate.mean[channel][s.index];
      pixel.variance[c] = estimate.variance[channel][s.index];
      for (size_t h = 0; h < 2; ++h) pixel.half[h][c] = estimate.half[h][channel][s.index];
    }
  }
  for (Rgb<float>* image : {&estimate.mean, &estimate.half[0], &estimate.half[1]}) replaceValues(*image, fireflies);
  replaceVariances(estimate.variance, fireflies);
  return before;
}

std::vector<PixelValues> judgingPixels(std::vector<PixelValues> before, const std::vector<Firefly>& fireflies) {
  for (size_t k = 0; k < before.size(); ++k) {
    const Firefly& s = fireflies[k];
    for (int c = 0; c < 3; ++c) {
      for (Spectrum* image : {&before[k].mean, &before[k].half[0], &before[k].half[1]})
        (*image)[c] = drawn((*image)[c], s.value[c], s.keptByJudge);
      before[k].variance[c] = drawn(before[k].variance[c], s.variance[c], s.keptByJudge);
    }
  }
  return before;
}

void swapPixels(Estimate& estimate, std::vector<PixelValues>& pixels) {
  for (PixelValues& pixel : pixels)
    for (int c = 0; c < 3; ++c) {
      const auto channel = static_cast<size_t>(c);
      std::swap(pixel.mean[c], estimate.mean[channel][pixel.index]);
      std::swap(pixel.variance[c], estimate.variance[channel][pixel.index]);
      for (size_t h = 0; h < 2; ++h) std::swap(pixel.half[h][c], estimate.half[h][channel][pixel.index]);
    }
}

void replaceValues(Rgb<float>& image, const std::vector<Firefly>& fireflies) {
  for (const Firefly& s : fireflies)
    for (size_t c = 0; c < 3; ++c) image[c][s.index] = drawn(image[c][s.index], s.value[static_cast<int>(c)], s.kept);
}

void replaceVariances(Rgb<float>& variance, const std::vector<Firefly>& fireflies) {
  for (const Firefly& s : fireflies)
    for (size_t c = 0; c < 3; ++c)
      variance[c][s.index] = drawn(variance[c][s.index], s.variance[static_cast<int>(c)], s.kept);
}

}  // namespace braid
