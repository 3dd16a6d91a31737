// SPDX-License-Identifier: Apache-2.0
#include <utility>

#include "renderer/core/error.h"
#include "renderer/core/moments.h"
#include "renderer/core/parallel.h"
#include "renderer/film/film.h"

namespace braid {

namespace {

using Planes = std::vector<Plane<double>>;

Plane<float> ratio(const Plane<double>& a, const Plane<double>* b, uint64_t n) {
  Plane<float> out(a.width, a.height);
  if (n == 0) return out;
  parallelChunks(a.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      out[i] = static_cast<float>((a[i] + (b ? (*b)[i] : 0.0)) / static_cast<double>(n));
  });
  return out;
}

}  // namespace

FeatureAccumulator::FeatureAccumulator(int width, int height)
    : sum_{Planes(kFeatureComponents, Plane<double>(width, height)),
           Planes(kFeatureComponents, Plane<double>(width, height))},
      sumsq_(kFeatureComponents, Plane<double>(width, height)) {}

void FeatureAccumulator::commit(uint64_t pass, const PassTarget& target, bool counts) {
  BRAID_ASSERT(target.wantsFeatures() && target.width_ == sumsq_[0].width && target.height_ == sumsq_[0].height);
  const size_t half = pass % 2;
  target.forEachRun([&](size_t begin, size_t width) {
    for (size_t c = 0; c < kFeatureComponents; ++c) {
      const float* __restrict in = target.features_[c].data.data() + begin;
      double* __restrict sum = sum_[half][c].data.data() + begin;
      double* __restrict sumsq = sumsq_[c].data.data() + begin;
      for (size_t x = 0; x < width; ++x) {
        const double v = static_cast<double>(in[x]);
        sum[x] += v;
        sumsq[x] += v * v;
      }
    }
  });
  if (counts) ++count_[half];
}

Plane<float> FeatureAccumulator::mean(int component) const {
  const auto c = static_cast<size_t>(component);
  return ratio(sum_[0][c], &sum_[1][c], passes());
}

Plane<float> FeatureAccumulator::halfMean(int component, int half) const {
  return ratio(sum_[half][static_cast<size_t>(component)], nullptr, count_[half]);
}

Plane<float> FeatureAccumulator::variance(int component) const {
  const auto c = static_cast<size_t>(component);
  const Plane<double>& a = sum_[0][c];
  Plane<float> out(a.width, a.height, kUnfilled);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = floatVarianceOfMean(a[i] + sum_[1][c][i], sumsq_[c][i], passes());
  });
  return out;
}

void CoverageAccumulator::commit(const PassTarget& target) {
  BRAID_ASSERT(target.wantsCoverage() && target.width_ == sum_.width && target.height_ == sum_.height);
  parallelChunks(sum_.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) sum_[i] += static_cast<double>(target.coverage_[i]);
  });
  ++count_;
}

Plane<float> CoverageAccumulator::mean() const { return ratio(sum_, nullptr, count_); }

}  // namespace braid
