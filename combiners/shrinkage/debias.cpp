// SPDX-License-Identifier: Apache-2.0
#include "combiners/shrinkage/debias.h"

#include <algorithm>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/channel_mean.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/finite_float.h"

namespace braid {

namespace {

constexpr int kRadius = 2;
constexpr double kEpsilon = 0.01;  // as in relL2
constexpr uint64_t kFewestPasses = 4;
constexpr double kEstimatedAsGone = 0.5;  // of what is taken away

double at(const Rgb<float>& image, size_t i, size_t c) { return static_cast<double>(image[c][i]); }

// a of every pixel.
Plane<float> shareToTake(const Estimate& s) {
  const Plane<float> level = channelMean(s.mean);
  const auto relative = [&](const auto& value) {
    return boxMean(
        channelMean(s.mean,
                    [&](size_t i, size_t c) { return value(i, c) / (sqr(static_cast<double>(level[i])) + kEpsilon); }),
        kRadius);
  };
  const Plane<double> noise = relative([&](size_t i, size_t c) { return at(s.biasVariance, i, c); });
  const Plane<double> squared =
      relative([&](size_t i, size_t c) { return sqr(at(s.bias, i, c)) - at(s.biasVariance, i, c); });
  Plane<float> share(level.width, level.height);
  for (size_t i = 0; i < share.size(); ++i)
    if (squared[i] > 0) share[i] = finiteFloat(squared[i] / (squared[i] + noise[i]));
  return share;
}

}  // namespace

Estimate debiased(const Estimate& photonMap) {
  Estimate out = photonMap;
  if (photonMap.bias.empty() || photonMap.biasVariance.empty() ||
      (photonMap.passes > 0 && photonMap.passes < kFewestPasses))
    return out;
  const Plane<float> share = shareToTake(photonMap);
  const auto halfOf = [&](size_t h) -> const Rgb<float>& {
    return photonMap.biasHalf[h].empty() ? photonMap.bias : photonMap.biasHalf[h];
  };
  out.variance = meanVariance(photonMap);
  parallelChunks(share.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i) {
        const double mean = std::max(0.0, at(photonMap.mean, i, c)), bias = at(photonMap.bias, i, c);
        auto a = static_cast<double>(share[i]);
        if (a * bias > mean) a = mean / bias;
        const auto correct = [&](Rgb<float>& image, const Rgb<float>& by) {
          if (!image.empty()) image[c][i] = finiteFloat(at(image, i, c) - a * at(by, i, c));
        };
        correct(out.mean, photonMap.bias);
        for (size_t h = 0; h < 2; ++h) correct(out.half[h], halfOf(h));
        for (size_t q = 0; q < out.quarter.size(); ++q) correct(out.quarter[q], halfOf(q % 2));
        const double noise = at(photonMap.biasVariance, i, c), left = 1 - kEstimatedAsGone * a;
        out.variance[c][i] = finiteFloat(at(out.variance, i, c) + sqr(a) * noise);
        out.bias[c][i] = finiteFloat(left * bias);
        out.biasVariance[c][i] = finiteFloat(sqr(left) * noise);
      }
  });
  for (Rgb<float>& half : out.biasHalf) half = Rgb<float>();
  return out;
}

}  // namespace braid
