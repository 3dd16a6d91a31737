// SPDX-License-Identifier: Apache-2.0
#include "tools/publish/estimated_error.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr double kFloor = 0.01;  // of `compare`

double channelMean(const Rgb<float>& image, size_t i) {
  return (static_cast<double>(image[0][i]) + static_cast<double>(image[1][i]) + static_cast<double>(image[2][i])) / 3;
}

float stored(double value) {
  return static_cast<float>(std::min(value, static_cast<double>(std::numeric_limits<float>::max())));
}

// Half A is a firefly where it is so many times its level; so many more of them, in a window of at most this radius,
// tell how much light they bring on average.
constexpr double kFirefly = 16;
constexpr double kSamples = 3;  // that have to speak for a value, at least
constexpr int kEnough = 3, kLargest = 16;

// Sum and number of values, those that are not finite left out.
struct Values {
  double sum = 0;
  int count = 0;
  void add(double value) {
    if (!std::isfinite(value)) return;
    sum += value;
    ++count;
  }
  double mean() const { return count > 0 ? sum / count : 0; }
  double meanWith(double value) const {
    Values all = *this;
    all.add(value);
    return all.mean();
  }
};

// Calls body(i) for the pixels of a window but its centre, as far as they lie in the image.
template <class Body>
void forNeighbours(const Plane<float>& plane, int x, int y, int radius, const Body& body) {
  for (int v = std::max(0, y - radius); v <= std::min(plane.height - 1, y + radius); ++v)
    for (int u = std::max(0, x - radius); u <= std::min(plane.width - 1, x + radius); ++u)
      if (u != x || v != y) body(plane.index(u, v));
}

// The levels of a noisy estimate, which must outlive this. Without halves, by the mean and its neighbours.
class NoisyLevels {
 public:
  explicit NoisyLevels(const Estimate& e)
      : e_(e), halves_(!e.half[0].empty() && !e.half[1].empty()), value_(e.mean.width(), e.mean.height(), kUnfilled) {
    parallelChunks(value_.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) value_[i] = static_cast<float>(channelMean(e_.mean, i));
    });
    level_[0] = level_[1] = Plane<float>(value_.width, value_.height, kUnfilled);
    firefly_ = Plane<uint8_t>(value_.width, value_.height);
    parallelRows(value_.height, [&](int y) {
      for (int x = 0; x < value_.width; ++x) findLevels(x, y);
    });
  }

  // T_A² + 0.01 or that of B.
  double squared(int half, int x, int y) const {
    const size_t i = value_.index(x, y);
    double level = static_cast<double>(level_[half][i]);
    if (firefly_[i] & (1 << half)) level += rareLight(x, y);
    return std::max(sqr(level), sqr(static_cast<double>(value_[i])) - kSamples * variance(i)) + kFloor;
  }

 private:
  double half(int h, size_t i) const { return halves_ ? channelMean(e_.half[h], i) : static_cast<double>(value_[i]); }
  // What T_A may know of the pixel itself.
  double other(int h, size_t i) const {
    return halves_ ? channelMean(e_.half[1 - h], i) : std::numeric_limits<double>::quiet_NaN();
  }

  void findLevels(int x, int y) {
    const size_t i = value_.index(x, y);
    Values near, far;
    forNeighbours(value_, x, y, 1, [&](size_t j) { near.add(static_cast<double>(value_[j])); });
    forNeighbours(value_, x, y, 2, [&](size_t j) { far.add(static_cast<double>(value_[j])); });
    for (int h = 0; h < 2; ++h) {
      double level = std::max(near.meanWith(other(h, i)), far.meanWith(other(h, i)));
      if (!halves_ && far.count == 0) level = static_cast<double>(value_[i]);  // the only pixel
      level_[h][i] = static_cast<float>(level);
      if (half(h, i) > kFirefly * level) firefly_[i] |= static_cast<uint8_t>(1 << h);
    }
  }

  double variance(size_t i) const { return e_.variance.empty() ? 0 : channelMean(e_.variance, i); }

  // What both halves of a firefly have beyond their levels, as the mean has it.
  double beyond(size_t i) const {
    double sum = 0;
    for (int h = 0; h < 2; ++h)
      if (firefly_[i] & (1 << h)) sum += half(h, i) - static_cast<double>(level_[h][i]);
    return sum / 2;
  }

  double rareLight(int x, int y) const {
    for (int radius = 1;; radius *= 2) {
      Values values;
      int fireflies = 0;
      forNeighbours(value_, x, y, radius, [&](size_t j) {
        values.add(firefly_[j] != 0 ? beyond(j) : 0);
        fireflies += firefly_[j] != 0 ? 1 : 0;
      });
      if (fireflies >= kEnough || radius >= kLargest) return values.mean();
    }
  }

  const Estimate& e_;
  const bool halves_;
  Plane<float> value_, level_[2];
  Plane<uint8_t> firefly_;  // bit h: half h is one
};

// Of the variance of a pixel, what belongs to half A.
double shareOfA(const Estimate& e, size_t i) {
  if (e.half[0].empty() || e.half[1].empty()) return 0.5;
  double ofA = 0, all = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double variance = e.variance.empty() ? 1 : static_cast<double>(e.variance[c][i]);
    const double a = sqr(static_cast<double>(e.half[0][c][i])), b = sqr(static_cast<double>(e.half[1][c][i]));
    ofA += variance * (a + b > 0 ? a / (a + b) : 0.5);
    all += variance;
  }
  const double share = ofA / all;
  return share >= 0 && share <= 1 ? share : 0.5;
}

}  // namespace

Plane<float> squaredLevels(const Estimate& e) {
  const NoisyLevels levels(e);
  Plane<float> out(e.mean.width(), e.mean.height(), kUnfilled);
  parallelRows(out.height, [&](int y) {
    for (int x = 0; x < out.width; ++x) {
      const size_t i = out.index(x, y);
      const double share = shareOfA(e, i);
      out[i] = stored(1 / (share / levels.squared(0, x, y) + (1 - share) / levels.squared(1, x, y)));
    }
  });
  return out;
}

Plane<float> squaredLevels(const Rgb<float>& image) {
  Plane<float> out(image.width(), image.height(), kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = stored(sqr(channelMean(image, i)) + kFloor);
  });
  return out;
}

double relativeError(const Plane<float>& error, const Plane<float>& squaredLevels) {
  struct Sum {
    double total = 0;
    uint64_t count = 0;
    Sum& operator+=(const Sum& other) {
      total += other.total;
      count += other.count;
      return *this;
    }
  };
  const Sum sum = parallelSum(error.size(), kPixelChunk, Sum{}, [&](size_t begin, size_t end) {
    Sum s;
    for (size_t i = begin; i < end; ++i) {
      const double value = static_cast<double>(error[i]) / static_cast<double>(squaredLevels[i]);
      if (!std::isfinite(value)) continue;
      s.total += value;
      ++s.count;
    }
    return s;
  });
  return sum.count > 0 ? sum.total / static_cast<double>(sum.count) : 0.0;
}

}  // namespace braid
