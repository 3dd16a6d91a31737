// SPDX-License-Identifier: Apache-2.0
#include "combiners/uncorrelated/uncorrelated_share.h"

#include <utility>

#include "combiners/pixels/finite_float.h"
#include "combiners/shrinkage/shrinkage.h"
#include "combiners/statistics/residual_scale.h"
#include "combiners/pixels/window_ratio.h"

namespace braid {

namespace {

constexpr int kRadius = 7;  // of the filter, too

// Variance of the mean of four quarters.
Plane<float> quartersVariance(const Estimate& e, size_t c) {
  Plane<float> out(e.mean.width(), e.mean.height(), kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      double mean = 0, squares = 0;
      for (const Rgb<float>& q : e.quarter) mean += static_cast<double>(q[c][i]) / 4;
      for (const Rgb<float>& q : e.quarter) squares += sqr(static_cast<double>(q[c][i]) - mean);
      out[i] = finiteFloat(squares / 12);
    }
  });
  return out;
}

}  // namespace

PlainMean plainMean(const Estimate& y, const Estimate& z) {
  PlainMean out{y, z, {}};
  for (size_t c = 0; c < 3; ++c) {
    const Plane<float> ofY = usualVariance(quartersVariance(y, c)), ofZ = usualVariance(quartersVariance(z, c));
    double sum = 0;
    for (size_t i = 0; i < ofY.size(); ++i) {
      const auto a = static_cast<double>(ofY[i]), b = static_cast<double>(ofZ[i]);
      sum += a + b > 0 ? a / (a + b) : 0.5;
    }
    out.weight[c] = sum / static_cast<double>(ofY.size());
  }
  return out;
}

std::array<Plane<float>, 3> combinedShares(const PlainMean& mean, const Rgb<float> (&combined)[2],
                                           const Rgb<float>& noise) {
  std::array<Plane<float>, 3> out;
  for (size_t c = 0; c < 3; ++c) {
    const Plane<double> unit = residualScale(mean.y.mean[c], mean.z.mean[c], noise[c], LevelOf::AlikeInNoise);
    Plane<double> products(unit.width, unit.height), squares(unit.width, unit.height);
    parallelChunks(products.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const double dm = mean.ofHalves(0, c, i) - mean.ofHalves(1, c, i);
        const double dx = static_cast<double>(combined[0][c][i]) - static_cast<double>(combined[1][c][i]);
        products[i] = dm * (dm - dx) / unit[i];
        squares[i] = sqr(dm - dx) / unit[i];
      }
    });
    out[c] = windowRatio(std::move(products), std::move(squares), kRadius, 1);
  }
  return out;
}

void takeShare(Rgb<float>& combined, const PlainMean& mean, const Rgb<float>& ofY, const Rgb<float>& ofZ,
               const std::array<Plane<float>, 3>& share) {
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(combined.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const double m = mean.at(ofY, ofZ, c, i);
        combined[c][i] = finiteFloat(m + static_cast<double>(share[c][i]) * (static_cast<double>(combined[c][i]) - m));
      }
    });
}

}  // namespace braid
