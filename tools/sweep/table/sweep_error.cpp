// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/table/sweep_error.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

struct Sum {
  double value = 0;
  uint64_t count = 0, invalid = 0;
  void operator+=(const Sum& s) { value += s.value, count += s.count, invalid += s.invalid; }
  double mean() const { return count > 0 ? value / static_cast<double>(count) : 0; }
};

double at(const Rgb<float>& image, size_t c, size_t i) { return static_cast<double>(image[c][i]); }

// Mean over pixels and channels of product(c, i) / (mean_RGB(R)² + 0.01).
template <class Product>
double relativeMean(const ReferenceImage& reference, const Rgb<float>& image, const Product& product) {
  const Rgb<float>&a = reference.half[0], &b = reference.half[1];
  const Sum sum = parallelSum(image.size(), kPixelChunk, Sum{}, [&](size_t begin, size_t end) {
    Sum s;
    for (size_t i = begin; i < end; ++i) {
      if (!isFinite(a.pixel(i)) || !isFinite(b.pixel(i))) continue;
      ++s.count;
      if (!isFinite(image.pixel(i))) {
        ++s.invalid;
        continue;
      }
      double level = 0, error = 0;
      for (size_t c = 0; c < 3; ++c) {
        level += 0.5 * (at(a, c, i) + at(b, c, i)) / 3;
        error += product(c, i) / 3;
      }
      s.value += error / (sqr(level) + 0.01);
    }
    return s;
  });
  return sum.invalid > 0 ? std::numeric_limits<double>::infinity() : sum.mean();
}

// Standard error of the same mean, from the scatter of the means of blocks; of a product that is not finite, none.
template <class Product>
double blockStandardError(const ReferenceImage& reference, const Product& product) {
  constexpr int kBlock = 16;
  const Rgb<float>&a = reference.half[0], &b = reference.half[1];
  double sum = 0, squares = 0, blocks = 0;
  for (int y0 = 0; y0 < a.height(); y0 += kBlock)
    for (int x0 = 0; x0 < a.width(); x0 += kBlock) {
      double block = 0, pixels = 0;
      for (int y = y0; y < std::min(a.height(), y0 + kBlock); ++y)
        for (int x = x0; x < std::min(a.width(), x0 + kBlock); ++x) {
          const size_t i = a[0].index(x, y);
          double level = 0, error = 0;
          for (size_t c = 0; c < 3; ++c) {
            level += 0.5 * (at(a, c, i) + at(b, c, i)) / 3;
            error += product(c, i) / 3;
          }
          const double value = error / (sqr(level) + 0.01);
          if (!std::isfinite(value)) continue;
          block += value;
          ++pixels;
        }
      if (pixels == 0) continue;
      sum += block / pixels;
      squares += sqr(block / pixels);
      ++blocks;
    }
  if (blocks < 2) return std::numeric_limits<double>::quiet_NaN();
  return std::sqrt(std::max(0.0, squares / blocks - sqr(sum / blocks)) / (blocks - 1));
}

}  // namespace

double relL2Unbiased(const Rgb<float>& image, const ReferenceImage& reference) {
  if (!reference.hasHalves()) return std::numeric_limits<double>::quiet_NaN();
  const Rgb<float>&a = reference.half[0], &b = reference.half[1];
  BRAID_ASSERT(image.size() == a.size() && image.width() == a.width());
  return relativeMean(reference, image, [&](size_t c, size_t i) {
    return (at(image, c, i) - at(a, c, i)) * (at(image, c, i) - at(b, c, i));
  });
}

SquaredBias relativeSquaredBias(const std::vector<Rgb<float>>& runs, const ReferenceImage& reference) {
  BRAID_ASSERT(runs.size() >= 2);
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (!reference.hasHalves()) return {kNone, kNone};
  const Rgb<float>&a = reference.half[0], &b = reference.half[1];
  for (const Rgb<float>& run : runs) BRAID_ASSERT(run.size() == a.size() && run.width() == a.width());
  const auto n = static_cast<double>(runs.size());
  const auto product = [&](size_t c, size_t i) {
    double toA = 0, toB = 0, squares = 0;
    for (const Rgb<float>& run : runs) {
      const double x = at(run, c, i) - at(a, c, i), y = at(run, c, i) - at(b, c, i);
      toA += x;
      toB += y;
      squares += x * y;
    }
    return (toA * toB - squares) / (n * (n - 1));
  };
  return {relativeMean(reference, runs.front(), product), blockStandardError(reference, product)};
}

double referenceNoise(const ReferenceImage& reference) {
  if (!reference.hasHalves()) return std::numeric_limits<double>::quiet_NaN();
  const Rgb<float>&a = reference.half[0], &b = reference.half[1];
  return relativeMean(reference, a, [&](size_t c, size_t i) { return sqr(0.5 * (at(a, c, i) - at(b, c, i))); });
}

Dominance dominance(const Rgb<float>& image, const Rgb<float>& baseline, const Rgb<float>& reference) {
  BRAID_ASSERT(image.size() == baseline.size() && image.size() == reference.size());
  struct Total {
    double difference = 0, better = 0, count = 0;
    void operator+=(const Total& t) { difference += t.difference, better += t.better, count += t.count; }
  };
  const Total total = parallelSum(image.size(), kPixelChunk, Total{}, [&](size_t begin, size_t end) {
    Total t;
    for (size_t i = begin; i < end; ++i) {
      if (!isFinite(reference.pixel(i))) continue;
      double own = 0, other = 0;
      for (size_t c = 0; c < 3; ++c) {
        own += sqr(at(image, c, i) - at(reference, c, i)) / 3;
        other += sqr(at(baseline, c, i) - at(reference, c, i)) / 3;
      }
      t += {own - other, own < other ? 1.0 : 0.0, 1.0};
    }
    return t;
  });
  if (total.count == 0) return {};
  return {total.better / total.count, total.difference / total.count};
}

}  // namespace braid
