// SPDX-License-Identifier: Apache-2.0
#include "combiners/unknown_bias.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "combiners/box_mean.h"
#include "combiners/channel_mean.h"
#include "combiners/error_map.h"
#include "combiners/finite_float.h"
#include "combiners/shrinkage.h"

namespace braid {

namespace {

constexpr int kRadius = 6;
constexpr double kSignificance = 2;
constexpr float kOutlier = 32;

}  // namespace

Plane<float> unknownSquaredBias(const Estimate& unbiased, const Estimate& photonMap) {
  if (!hasHalves(unbiased) || !hasHalves(photonMap)) return {};
  const auto difference = [](const Rgb<float>& x, const Rgb<float>& y, size_t i, size_t c) {
    return static_cast<double>(x[c][i]) - static_cast<double>(y[c][i]);
  };
  Plane<float> products = channelMean(unbiased.mean, [&](size_t i, size_t c) {
    const double product =
        difference(unbiased.half[0], photonMap.half[0], i, c) * difference(unbiased.half[1], photonMap.half[1], i, c);
    return difference(unbiased.mean, photonMap.mean, i, c) < 0 ? -product : product;
  });
  Plane<float> size(products.width, products.height);
  for (size_t i = 0; i < size.size(); ++i) size[i] = std::fabs(products[i]);
  const Plane<float> usual = usualVariance(size);
  for (size_t i = 0; i < size.size(); ++i) {
    const float limit = std::min(std::numeric_limits<float>::max(), kOutlier * usual[i]);
    products[i] = std::clamp(products[i], -limit, limit);
    size[i] = finiteFloat(static_cast<double>(products[i]) * static_cast<double>(products[i]));
  }
  const Plane<double> mean = boxMean(products, kRadius), square = boxMean(size, kRadius);
  Plane<float> out(products.width, products.height);
  const double pixels = (2.0 * kRadius + 1) * (2.0 * kRadius + 1);
  for (size_t i = 0; i < out.size(); ++i)
    if (mean[i] > kSignificance * std::sqrt(square[i] / pixels)) out[i] = finiteFloat(mean[i]);
  return out;
}

}  // namespace braid
