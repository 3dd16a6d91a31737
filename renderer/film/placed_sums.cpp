// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/placed_sums.h"

#include <algorithm>

#include "renderer/core/box_sum.h"
#include "renderer/core/error.h"
#include "renderer/core/moments.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

uint64_t whole(double samples) { return static_cast<uint64_t>(samples); }
double ratio(double sum, double samples) { return samples > 0 ? sum / samples : 0.0; }

// (a + b) / 2, or the one that has samples.
double meanOfHalves(const SamplePlacement& p, size_t tile, double a, double b) {
  if (p.ofHalf(tile, 1) == 0) return a;
  return p.ofHalf(tile, 0) == 0 ? b : 0.5 * (a + b);
}

template <class Value>
Rgb<float> imageOf(const SamplePlacement& placement, const Value& value) {
  Rgb<float> out(placement.width, placement.height, kUnfilled);
  for (size_t c = 0; c < 3; ++c)
    forEachPlacedPixel(placement, [&](size_t i, size_t tile) { out[c][i] = static_cast<float>(value(c, i, tile)); });
  return out;
}

}  // namespace

PlacedSums::PlacedSums(const Accumulator& sums, const SamplePlacement& placement) : sums_(sums), placement_(placement) {
  BRAID_ASSERT(sums.bucketCount() == 4 && sums.squares().size() == 2 && !sums.keepsBias());
  BRAID_ASSERT(sums.width() == placement.width && sums.height() == placement.height);
}

double PlacedSums::meanOfHalf(size_t c, size_t i, size_t tile, int half) const {
  const auto h = static_cast<size_t>(half);
  return ratio(sums_.sums()[h][c][i] + sums_.sums()[h + 2][c][i], placement_.ofHalf(tile, half));
}

Rgb<float> PlacedSums::mean() const {
  return imageOf(placement_, [&](size_t c, size_t i, size_t tile) {
    return meanOfHalves(placement_, tile, meanOfHalf(c, i, tile, 0), meanOfHalf(c, i, tile, 1));
  });
}

Rgb<float> PlacedSums::halfMean(int half) const {
  return imageOf(placement_, [&](size_t c, size_t i, size_t tile) { return meanOfHalf(c, i, tile, half); });
}

Rgb<float> PlacedSums::bucketMean(int k) const {
  const auto bucket = static_cast<size_t>(k);
  return imageOf(placement_, [&](size_t c, size_t i, size_t tile) {
    return ratio(sums_.sums()[bucket][c][i], placement_.count[bucket][tile]);
  });
}

// The variance of a half's mean from the spread of its samples.
double PlacedSums::withinHalf(size_t c, size_t i, size_t tile, int half) const {
  const auto h = static_cast<size_t>(half);
  return varianceOfMean(sums_.sums()[h][c][i] + sums_.sums()[h + 2][c][i], sums_.squares()[h][c][i],
                        whole(placement_.ofHalf(tile, half)));
}

// The same from its two buckets, Σ w_k (m_k - m)² with w_k their shares of the samples; that of the samples where one
// of them has none.
double PlacedSums::betweenBuckets(size_t c, size_t i, size_t tile, int half) const {
  const auto h = static_cast<size_t>(half);
  const double n[] = {placement_.count[h][tile], placement_.count[h + 2][tile]}, all = n[0] + n[1];
  if (!(n[0] > 0 && n[1] > 0)) return withinHalf(c, i, tile, half);
  const double difference = sums_.sums()[h][c][i] / n[0] - sums_.sums()[h + 2][c][i] / n[1];
  return n[0] * n[1] / (all * all) * difference * difference;
}

// Accumulator::variance(): within() times the ratio of both over boxes of pixels. The spread between `groups` + 1
// groups of samples is part of that of all, which bounds the ratio.
template <class Within, class Between, class Samples>
Rgb<float> PlacedSums::calibrated(const Within& within, const Between& between, const Samples& samples,
                                  double groups) const {
  Rgb<float> out(placement_.width, placement_.height, kUnfilled);
  for (size_t c = 0; c < 3; ++c) {
    Plane<double> ofSamples(placement_.width, placement_.height, kUnfilled), ofBuckets = ofSamples;
    forEachPlacedPixel(placement_, [&](size_t i, size_t tile) {
      ofSamples[i] = within(c, i, tile);
      ofBuckets[i] = between(c, i, tile);
    });
    const Plane<double> ours = boxSum(ofSamples, kVarianceBoxRadius), theirs = boxSum(ofBuckets, kVarianceBoxRadius);
    forEachPlacedPixel(placement_, [&](size_t i, size_t tile) {
      const double limit = std::max(1.0, (samples(tile) - 1) / groups);
      const double scale = ours[i] > 0 ? std::min(theirs[i] / ours[i], limit) : 0.0;
      out[c][i] = floatVariance(ofSamples[i] * scale);
    });
  }
  return out;
}

Rgb<float> PlacedSums::variance(bool lowDiscrepancy) const {
  const auto within = [&](size_t c, size_t i, size_t tile) {
    const double a = withinHalf(c, i, tile, 0), b = withinHalf(c, i, tile, 1);
    return meanOfHalves(placement_, tile, a, b) *
           (placement_.ofHalf(tile, 0) > 0 && placement_.ofHalf(tile, 1) > 0 ? 0.5 : 1.0);
  };
  if (!lowDiscrepancy)
    return imageOf(placement_, [&](size_t c, size_t i, size_t tile) { return floatVariance(within(c, i, tile)); });
  // Two degrees of freedom inside of the halves and one between them, of equal weight.
  const auto between = [&](size_t c, size_t i, size_t tile) {
    const double inside = 0.25 * (betweenBuckets(c, i, tile, 0) + betweenBuckets(c, i, tile, 1));
    const double across = 0.25 * sqr(meanOfHalf(c, i, tile, 0) - meanOfHalf(c, i, tile, 1));
    return (2 * inside + across) / 3;
  };
  return calibrated(
      within, between, [&](size_t tile) { return placement_.total(tile); }, 3);
}

Rgb<float> PlacedSums::halfVariance(int half, bool lowDiscrepancy) const {
  const auto within = [&](size_t c, size_t i, size_t tile) { return withinHalf(c, i, tile, half); };
  if (!lowDiscrepancy)
    return imageOf(placement_, [&](size_t c, size_t i, size_t tile) { return floatVariance(within(c, i, tile)); });
  return calibrated(
      within, [&](size_t c, size_t i, size_t tile) { return betweenBuckets(c, i, tile, half); },
      [&](size_t tile) { return placement_.ofHalf(tile, half); }, 1);
}

Plane<float> PlacedFeatures::halfMean(int component, int half) const {
  const Plane<double>& sum = features_.sums(half)[static_cast<size_t>(component)];
  Plane<float> out(sum.width, sum.height, kUnfilled);
  forEachPlacedPixel(placement_, [&](size_t i, size_t tile) {
    out[i] = static_cast<float>(ratio(sum[i], placement_.ofHalf(tile, half)));
  });
  return out;
}

Plane<float> PlacedFeatures::mean(int component) const {
  const auto c = static_cast<size_t>(component);
  const Plane<double>&a = features_.sums(0)[c], &b = features_.sums(1)[c];
  Plane<float> out(a.width, a.height, kUnfilled);
  forEachPlacedPixel(placement_, [&](size_t i, size_t tile) {
    out[i] = static_cast<float>(meanOfHalves(placement_, tile, ratio(a[i], placement_.ofHalf(tile, 0)),
                                             ratio(b[i], placement_.ofHalf(tile, 1))));
  });
  return out;
}

// s²/4 (1/n_A + 1/n_B), s² the variance of all samples.
Plane<float> PlacedFeatures::variance(int component) const {
  const auto c = static_cast<size_t>(component);
  const Plane<double>&a = features_.sums(0)[c], &b = features_.sums(1)[c], &squares = features_.sumsOfSquares()[c];
  Plane<float> out(a.width, a.height, kUnfilled);
  forEachPlacedPixel(placement_, [&](size_t i, size_t tile) {
    const double nA = placement_.ofHalf(tile, 0), nB = placement_.ofHalf(tile, 1), n = nA + nB;
    const double uneven = nA > 0 && nB > 0 ? n * n / (4 * nA * nB) : 1.0;
    out[i] = floatVariance(uneven * varianceOfMean(a[i] + b[i], squares[i], whole(n)));
  });
  return out;
}

}  // namespace braid
