// SPDX-License-Identifier: Apache-2.0
#include "combiners/shrinkage/cross_half_bias.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/channel_mean.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/shrinkage/shrinkage.h"

namespace braid {

namespace {

constexpr int kRadius = 6;
constexpr double kSignificance = 2;
constexpr double kFirefly = 32;

double difference(const Rgb<float>& x, const Rgb<float>& y, size_t i, size_t c) {
  return static_cast<double>(x[c][i]) - static_cast<double>(y[c][i]);
}

template <class Value>
Plane<float> mapped(const Plane<float>& in, const Value& value) {
  Plane<float> out(in.width, in.height, kUnfilled);
  parallelChunks(in.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = finiteFloat(value(i));
  });
  return out;
}

// The values, none of them farther from 0 than 32 times what is usual around it: a firefly would hide its window.
Plane<float> limited(const Plane<float>& in) {
  const Plane<float> usual = usualVariance(mapped(in, [&](size_t i) { return std::fabs(static_cast<double>(in[i])); }));
  return mapped(in, [&](size_t i) {
    const double limit = kFirefly * static_cast<double>(usual[i]);
    return std::clamp(static_cast<double>(in[i]), -limit, limit);
  });
}

}  // namespace

Plane<float> crossHalfSquaredBias(const Estimate& unbiased, const Estimate& photonMap) {
  if (!hasHalves(unbiased) || !hasHalves(photonMap)) return {};
  const Plane<float> products = limited(channelMean(unbiased.mean, [&](size_t i, size_t c) {
    const double product =
        difference(unbiased.half[0], photonMap.half[0], i, c) * difference(unbiased.half[1], photonMap.half[1], i, c);
    return difference(unbiased.mean, photonMap.mean, i, c) < 0 ? -product : product;
  }));
  const Plane<double> mean = boxMean(products, kRadius);
  const Plane<double> square =
      boxMean(mapped(products, [&](size_t i) { return sqr(static_cast<double>(products[i])); }), kRadius);
  const double pixels = (2.0 * kRadius + 1) * (2.0 * kRadius + 1);
  return mapped(products,
                [&](size_t i) { return mean[i] > kSignificance * std::sqrt(square[i] / pixels) ? mean[i] : 0.0; });
}

}  // namespace braid
