// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/half_statistics.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/channel_mean.h"
#include "combiners/pixels/finite_float.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kBiasRadius = 7;
constexpr double kMostFiltered = 49;  // C of mixtureErrorMap()

double squaredDifference(const Rgb<float>& a, const Rgb<float>& b, size_t i, size_t c) {
  const double d = static_cast<double>(a[c][i]) - static_cast<double>(b[c][i]);
  return d * d;
}

Plane<float> varianceSamples(const Rgb<float> (&halves)[2]) {
  return channelMean(halves[0].width(), halves[0].height(),
                     [&](size_t i, size_t c) { return 0.25 * squaredDifference(halves[0], halves[1], i, c); });
}

double channelMeanOf(const Rgb<float>& image, size_t i) {
  return (static_cast<double>(image[0][i]) + static_cast<double>(image[1][i]) + static_cast<double>(image[2][i])) / 3;
}

// What errors are measured in to be relative: the squared brightness + 0.01.
Plane<float> relativeUnits(const Rgb<float>& guide) {
  Plane<float> unit(guide.width(), guide.height(), kUnfilled);
  parallelChunks(unit.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double level = channelMeanOf(guide, i);
      unit[i] = finiteFloat(level * level + 0.01);
    }
  });
  return unit;
}

}  // namespace

Rgb<float> meanVariance(const Estimate& e) {
  if (!e.variance.empty()) return e.variance;
  Rgb<float> out(e.mean.width(), e.mean.height());
  if (!hasHalves(e)) return out;
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i)
        out[c][i] = finiteFloat(0.25 * squaredDifference(e.half[0], e.half[1], i, c));
  });
  return out;
}

Estimate filterInput(const Estimate& e) {
  Estimate out;
  out.name = e.name;
  out.correlation = e.correlation;
  out.passes = e.passes;
  out.mean = e.mean;
  for (size_t h = 0; h < 2; ++h) out.half[h] = e.half[h];
  out.variance = meanVariance(e);
  return out;
}

bool hasHalves(const Estimate& e) { return !e.half[0].empty() && !e.half[1].empty(); }

Rgb<float> halfVariance(const Estimate& x, const Rgb<float>& variance, int h) {
  Rgb<float> out(variance.width(), variance.height(), kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i) {
        const double own = sqr(static_cast<double>(x.half[h][c][i]));
        const double both = own + sqr(static_cast<double>(x.half[1 - h][c][i]));
        out[c][i] = finiteFloat(4 * static_cast<double>(variance[c][i]) * (both > 0 ? own / both : 0.5));
      }
  });
  return out;
}

Plane<float> squaredErrorSamples(const Rgb<float> (&halves)[2], const Estimate& unbiased, const Rgb<float>& variance) {
  return channelMean(halves[0].width(), halves[0].height(), [&](size_t i, size_t c) {
    const double half = 0.5 * (squaredDifference(halves[0], unbiased.half[1], i, c) +
                               squaredDifference(halves[1], unbiased.half[0], i, c));
    return half - 2 * static_cast<double>(variance[c][i]) - 0.25 * squaredDifference(halves[0], halves[1], i, c);
  });
}

Plane<float> crossHalfErrorMap(const Rgb<float> (&halves)[2], const Estimate& unbiased, const Rgb<float>& variance,
                               const Rgb<float>& guide) {
  // The planes take the relative values in the place of the samples, then their means, and last the errors.
  Plane<float> samples = squaredErrorSamples(halves, unbiased, variance);
  Plane<float> spread = varianceSamples(halves);
  const Plane<float> unit = relativeUnits(guide);
  parallelChunks(unit.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const auto u = static_cast<double>(unit[i]);
      samples[i] = finiteFloat((static_cast<double>(samples[i]) - static_cast<double>(spread[i])) /
                               (u + channelMeanOf(variance, i)));
      spread[i] = finiteFloat(static_cast<double>(spread[i]) / u);
    }
  });
  spread = boxMean<float>(spread, 1);
  samples = boxMean<float>(samples, kBiasRadius);
  Plane<float> out = std::move(samples);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      out[i] = finiteFloat(static_cast<double>(unit[i]) *
                           (static_cast<double>(spread[i]) + std::max(0.0, static_cast<double>(out[i]))));
  });
  return out;
}

Plane<float> mixtureErrorMap(const Rgb<float> (&halves)[2], const Rgb<float>& variance, const Rgb<float>& guide,
                             const Plane<float>& shared) {
  Plane<float> spread = varianceSamples(halves);
  Plane<float> noise(guide.width(), guide.height(), kUnfilled);
  const Plane<float> unit = relativeUnits(guide);
  parallelChunks(unit.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const auto u = static_cast<double>(unit[i]);
      spread[i] = finiteFloat(static_cast<double>(spread[i]) / u);
      noise[i] = finiteFloat(channelMeanOf(variance, i) / u);
    }
  });
  const Plane<float> wide = boxMean<float>(spread, kBiasRadius);
  noise = boxMean<float>(noise, kBiasRadius);
  spread = boxMean<float>(spread, 1);
  parallelChunks(unit.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const auto s = static_cast<double>(wide[i]), v = static_cast<double>(noise[i]);
      const double ratio = v > s ? 1 / std::sqrt(1 / kMostFiltered + s / v) : 1;
      double error = static_cast<double>(unit[i]) * static_cast<double>(spread[i]) * std::max(1.0, ratio);
      if (!shared.empty() && v > s) error += sqr(1 - std::sqrt(s / v)) * static_cast<double>(shared[i]);
      spread[i] = finiteFloat(error);
    }
  });
  return spread;
}

Plane<float> smoothedSquaredBias(const Plane<float>& squaredBias, const Rgb<float>& guide) {
  const Plane<float> unit = relativeUnits(guide);
  Plane<float> relative(guide.width(), guide.height(), kUnfilled);
  parallelChunks(unit.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      relative[i] = finiteFloat(static_cast<double>(squaredBias[i]) / static_cast<double>(unit[i]));
  });
  Plane<float> out = boxMean<float>(relative, kBiasRadius);
  parallelChunks(unit.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      out[i] = finiteFloat(static_cast<double>(unit[i]) * std::max(0.0, static_cast<double>(out[i])));
  });
  return out;
}

}  // namespace braid
