// SPDX-License-Identifier: Apache-2.0
#include "combiners/shrinkage/shrinkage_errors.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/box_mean.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/channel_mean.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/statistics/surface_smooth.h"
#include "combiners/shrinkage/shrinkage.h"
#include "combiners/shrinkage/cross_half_bias.h"

namespace braid {

namespace {

constexpr int kRadius = 6;
constexpr int kLevelRadius = 1;         // of the brightness in whose units errors are averaged
constexpr double kLevelEpsilon = 0.01;  // as in relL2
constexpr double kWinsorise = 8;
constexpr double kSignificance = 3;
constexpr double kMargin = 1.1;  // of an error that is an estimate, too: the roundings of one of 10⁶ would be light
constexpr double kPhotonMapDeviations = 1.5;  // of its window mean: one firefly alone makes a mean of one deviation
constexpr double kFirefly = 64;

double at(const Rgb<float>& image, size_t i, size_t c) { return static_cast<double>(image[c][i]); }

double biasVarianceAt(const Estimate& e, size_t i, size_t c) {
  return e.biasVariance.empty() ? 0.0 : at(e.biasVariance, i, c);
}

// error := max(error, scale (m² + offset)), m the channel mean of the image.
void raise(Plane<float>& error, const Rgb<float>& image, double scale, double offset) {
  parallelChunks(error.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double m = (at(image, i, 0) + at(image, i, 1) + at(image, i, 2)) / 3;
      error[i] = finiteFloat(std::max(static_cast<double>(error[i]), scale * (m * m + offset)));
    }
  });
}

Plane<float> boxed(const Plane<float>& in) {
  const Plane<double> mean = boxMean(in, kRadius);
  Plane<float> out(in.width, in.height);
  for (size_t i = 0; i < out.size(); ++i) out[i] = finiteFloat(mean[i]);
  return out;
}

// Means over the window without the largest value, 0 where that is negative.
Plane<double> trimmedMean(const Plane<float>& in) {
  Plane<float> rows(in.width, in.height);
  parallelRows(in.height, [&](int y) {
    for (int x = 0; x < in.width; ++x)
      for (int i = std::max(0, x - kRadius); i <= std::min(in.width - 1, x + kRadius); ++i)
        rows.at(x, y) = std::max(rows.at(x, y), in.at(i, y));
  });
  Plane<double> out = boxSum(in, kRadius);
  parallelRows(in.height, [&](int y) {
    const int first = std::max(0, y - kRadius), last = std::min(in.height - 1, y + kRadius);
    for (int x = 0; x < in.width; ++x) {
      float largest = 0;
      for (int j = first; j <= last; ++j) largest = std::max(largest, rows.at(x, j));
      const int columns = std::min(in.width - 1, x + kRadius) - std::max(0, x - kRadius) + 1;
      const int others = std::max(1, columns * (last - first + 1) - 1);
      out.at(x, y) = std::max(0.0, out.at(x, y) - static_cast<double>(largest)) / others;
    }
  });
  return out;
}

// Variances of at most 64 times what is usual around them.
Plane<float> withoutFireflies(const Plane<float>& variance) {
  const Plane<float> usual = usualVariance(variance);
  Plane<float> out = variance;
  for (size_t i = 0; i < out.size(); ++i)
    out[i] = std::min(out[i], finiteFloat(kFirefly * static_cast<double>(usual[i])));
  return out;
}

}  // namespace

Plane<float> unbiasedError(const Estimate& unbiased, const Rgb<float>& variance) {
  Plane<float> error = boxed(channelMean(variance));
  raise(error, unbiased.mean, 1e-8, 1e-4);
  return error;
}

Plane<float> squaredBiasSamples(const Estimate& photonMap) {
  return channelMean(photonMap.mean.width(), photonMap.mean.height(), [&](size_t i, size_t c) {
    return sqr(at(photonMap.bias, i, c)) - biasVarianceAt(photonMap, i, c);
  });
}

Plane<float> biasedErrorSamples(const Estimate& y, const Estimate& x, const Rgb<float>& varianceOfX) {
  Plane<float> out = y.bias.empty() ? squaredErrorSamples(y.half, x, varianceOfX) : squaredBiasSamples(y);
  const Plane<float> variance = y.bias.empty() ? Plane<float>() : channelMean(meanVariance(y));
  for (size_t i = 0; i < out.size(); ++i) out[i] = std::max(0.0f, out[i] + (variance.empty() ? 0.0f : variance[i]));
  return out;
}

PhotonMapError photonMapError(const Estimate& photonMap, const Features* features, const Estimate* unbiased) {
  const Rgb<float> noise = meanVariance(photonMap);
  const Plane<float> spread = channelMean(noise);
  const Plane<float> squaredBias = squaredBiasSamples(photonMap);
  const Plane<float> limited = withoutFireflies(spread);
  std::vector<Plane<float>> smooth = surfaceSmooth({&limited, &squaredBias}, features, kRadius);
  PhotonMapError error{std::move(smooth[0]), std::move(smooth[1])};
  for (size_t i = 0; i < noise.size(); ++i) {
    if (limited[i] < spread[i]) error.variance[i] = spread[i];
    double deviation = 0;
    for (size_t c = 0; c < 3; ++c) deviation += biasVarianceAt(photonMap, i, c) / 3;
    const double own = static_cast<double>(squaredBias[i]);
    const bool significant = own + deviation > sqr(kSignificance) * deviation;
    error.squaredBias[i] = std::max({0.0f, error.squaredBias[i], significant ? finiteFloat(own) : 0.0f});
  }
  if (!unbiased) return error;
  const Plane<float> unknown = crossHalfSquaredBias(*unbiased, photonMap);
  for (size_t i = 0; i < unknown.size(); ++i) error.squaredBias[i] = std::max(error.squaredBias[i], unknown[i]);
  return error;
}

Plane<float> totalError(const Estimate& photonMap, const PhotonMapError& error) {
  Plane<float> sum = error.variance;
  for (size_t i = 0; i < sum.size(); ++i)
    sum[i] = finiteFloat(static_cast<double>(sum[i]) + static_cast<double>(error.squaredBias[i]));
  raise(sum, photonMap.mean, 1e-8, 1e-4);
  return sum;
}

Plane<float> biasedError(const Estimate& biased, const Estimate& unbiased, const Rgb<float>& variance,
                         const Features* features, bool measured) {
  if (!biased.bias.empty()) return totalError(biased, photonMapError(biased, features, measured ? &unbiased : nullptr));
  const Plane<float> samples = hasHalves(biased) && hasHalves(unbiased)
                                   ? squaredErrorSamples(biased.half, unbiased, variance)
                                   : channelMean(variance, [&](size_t i, size_t c) {
                                       const double d = at(biased.mean, i, c) - at(unbiased.mean, i, c);
                                       return d * d - at(variance, i, c);
                                     });
  Plane<float> error = std::move(surfaceSmooth({&samples}, features, kRadius)[0]);
  raise(error, biased.mean, 1e-8, 1e-4);
  return error;
}

void countMissingLight(Plane<float>& error, const Estimate& unbiased, const Rgb<float>& variance,
                       const Estimate& photonMap, const Plane<float>& photonMapError) {
  const Plane<float> difference =
      channelMean(variance, [&](size_t i, size_t c) { return at(photonMap.mean, i, c) - at(unbiased.mean, i, c); });
  const Plane<float> noise = channelMean(meanVariance(photonMap));
  const Plane<double> v = boxMean(channelMean(variance), kRadius);
  const double pixels = sqr(2.0 * kRadius + 1);
  const auto raiseWhereDark = [&](const Plane<double>& missing, const Plane<double>& noiseAround) {
    for (size_t i = 0; i < error.size(); ++i) {
      const auto explained = static_cast<double>(photonMapError[i]);
      const double deviation =
          std::sqrt((sqr(kSignificance) * v[i] + sqr(kPhotonMapDeviations) * noiseAround[i]) / pixels);
      if (missing[i] > kMargin * std::sqrt(explained) + deviation)
        error[i] = std::max(error[i], finiteFloat(missing[i] * missing[i] - explained));
    }
  };
  raiseWhereDark(boxMean(difference, kRadius), boxMean(noise, kRadius));
  raiseWhereDark(trimmedMean(difference), trimmedMean(noise));  // light that a firefly's noise would hide
}

Plane<float> priorError(const Rgb<float>& prior, const Rgb<float> (&halves)[2], const Estimate& x,
                        const Rgb<float>& variance, const Plane<float>& error) {
  const auto across = [&](size_t i, size_t c, double limit) {
    const auto square = [limit](double d) { return std::min(d * d, limit); };
    return 0.5 *
           (square(at(halves[0], i, c) - at(x.half[1], i, c)) + square(at(halves[1], i, c) - at(x.half[0], i, c)));
  };
  const Plane<double> around =
      trimmedMean(channelMean(prior, [&](size_t i, size_t c) { return across(i, c, HUGE_VAL); }));
  Plane<float> samples = channelMean(prior, [&](size_t i, size_t c) {
    const double limit = kWinsorise * kWinsorise * std::max(2 * static_cast<double>(error[i]), around[i]);
    const double between = at(halves[0], i, c) - at(halves[1], i, c);
    return across(i, c, limit) - 2 * at(variance, i, c) - 0.25 * between * between;
  });
  const Plane<double> level = boxMean(channelMean(prior), kLevelRadius);
  const auto unit = [&](size_t i) { return std::sqrt(sqr(level[i]) + kLevelEpsilon); };
  for (size_t i = 0; i < samples.size(); ++i) samples[i] = finiteFloat(static_cast<double>(samples[i]) / unit(i));
  Plane<float> out = boxed(samples);
  for (size_t i = 0; i < out.size(); ++i) out[i] = finiteFloat(static_cast<double>(out[i]) * unit(i));
  raise(out, prior, 1e-6, 1e-2);
  return out;
}

}  // namespace braid
