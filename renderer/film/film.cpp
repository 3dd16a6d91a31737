// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/film.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "renderer/core/box_sum.h"
#include "renderer/core/error.h"
#include "renderer/core/moments.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

void commitRow(const float* __restrict own, double* __restrict sum, double* __restrict sumsq, size_t width) {
  for (size_t x = 0; x < width; ++x) {
    const double v = static_cast<double>(own[x]);
    sum[x] += v;
    sumsq[x] += v * v;
  }
}

// `splats` is interleaved: 3 values a pixel. The sum is rounded to float so that a pass value has one type everywhere.
// A negative splat sum can only be an overflow (more than 512 clamped splats in one pixel): the pixel then has the
// largest value there is.
void commitRow(const float* __restrict own, const int64_t* __restrict splats, double unit, double* __restrict sum,
               double* __restrict sumsq, size_t width) {
  for (size_t x = 0; x < width; ++x) {
    const int64_t fixed = splats[3 * x];
    const double splat = fixed < 0 ? 0x1p63 : static_cast<double>(fixed);
    const double v = static_cast<double>(static_cast<float>(static_cast<double>(own[x]) + splat * unit));
    sum[x] += v;
    sumsq[x] += v * v;
  }
}

}  // namespace

Accumulator::Accumulator(int width, int height, int buckets, bool bias, KeptSquares squares)
    : sum_(static_cast<size_t>(buckets), Rgb<double>(width, height)),
      squares_(squares == KeptSquares::Halves ? 2 : 1, Rgb<double>(width, height)),
      keepsBias_(bias),
      count_(static_cast<size_t>(buckets), 0) {
  BRAID_ASSERT(buckets >= 2 && buckets % 2 == 0);
  if (bias) biasSum_[0] = biasSum_[1] = biasSumsq_ = Rgb<double>(width, height);
}

Accumulator Accumulator::fromSums(std::vector<Rgb<double>> sums, std::vector<Rgb<double>> squares,
                                  std::vector<uint64_t> counts) {
  Accumulator a(0, 0, static_cast<int>(sums.size()));
  BRAID_ASSERT(counts.size() == sums.size());
  for (const Rgb<double>& s : sums) BRAID_ASSERT(s.width() == squares[0].width() && s.height() == squares[0].height());
  a.sum_ = std::move(sums);
  a.squares_ = std::move(squares);
  a.setCounts(std::move(counts), 0, 0);
  return a;
}

Accumulator Accumulator::fromSums(std::vector<Rgb<double>> sums, Rgb<double> sumOfSquares, std::vector<uint64_t> counts,
                                  uint64_t rejected, uint64_t clampedSplats) {
  std::vector<Rgb<double>> squares;
  squares.push_back(std::move(sumOfSquares));
  Accumulator a = fromSums(std::move(sums), std::move(squares), std::move(counts));
  a.rejected_ = rejected;
  a.clampedSplats_ = clampedSplats;
  return a;
}

void Accumulator::commit(uint64_t pass, const PassTarget& target, bool counts) {
  BRAID_ASSERT(target.width_ == width() && target.height_ == height());
  const size_t bucket = pass % count_.size();
  Rgb<double>&sum = sum_[bucket], &squares = squaresOf(pass);
  const double unit = 1 / target.splatScale_;
  target.forEachRun([&](size_t begin, size_t width) {
    for (size_t c = 0; c < 3; ++c) {
      const float* own = target.own_[c].data.data() + begin;
      double* s = sum[c].data.data() + begin;
      double* q = squares[c].data.data() + begin;
      if (target.splats_.empty())
        commitRow(own, s, q, width);
      else
        commitRow(own, target.splats_.data() + 3 * begin + c, unit, s, q, width);
    }
  });
  if (keepsBias()) commitBias(static_cast<int>(pass % 2), target);
  if (counts) ++count_[bucket];
  rejected_ += target.rejected();
  clampedSplats_ += target.clampedSplats();
}

void Accumulator::commit(uint64_t pass, const Rgb<float>& values) {
  BRAID_ASSERT(values.width() == width() && values.height() == height());
  parallelRows(height(), [&](int y) { commitRun(pass, values, values[0].index(0, y), static_cast<size_t>(width())); });
  ++count_[pass % count_.size()];
}

void Accumulator::commitRun(uint64_t pass, const Rgb<float>& values, size_t begin, size_t count) {
  Rgb<double>&sum = sum_[pass % count_.size()], &squares = squaresOf(pass);
  for (size_t c = 0; c < 3; ++c)
    commitRow(values[c].data.data() + begin, sum[c].data.data() + begin, squares[c].data.data() + begin, count);
}

void Accumulator::commitBias(int half, const PassTarget& target) {
  BRAID_ASSERT(target.wantsBias());
  const auto width = static_cast<size_t>(squares_[0].width());
  parallelRows(height(), [&](int y) {
    const size_t begin = static_cast<size_t>(y) * width;
    for (size_t c = 0; c < 3; ++c)
      commitRow(target.bias_[c].data.data() + begin, biasSum_[half][c].data.data() + begin,
                biasSumsq_[c].data.data() + begin, width);
  });
}

Rgb<float> Accumulator::biasMean() const {
  Rgb<float> out(biasSumsq_.width(), biasSumsq_.height());
  const double scale = passes() > 0 ? 1 / static_cast<double>(passes()) : 0.0;
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        out[c][i] = static_cast<float>((biasSum_[0][c][i] + biasSum_[1][c][i]) * scale);
    });
  return out;
}

Rgb<float> Accumulator::biasHalfMean(int half) const {
  Rgb<float> out(biasSumsq_.width(), biasSumsq_.height());
  uint64_t n = 0;
  for (size_t k = static_cast<size_t>(half); k < count_.size(); k += 2) n += count_[k];
  const double scale = n > 0 ? 1 / static_cast<double>(n) : 0.0;
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) out[c][i] = static_cast<float>(biasSum_[half][c][i] * scale);
    });
  return out;
}

Rgb<float> Accumulator::biasVariance() const {
  Rgb<float> out(biasSumsq_.width(), biasSumsq_.height());
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        out[c][i] = floatVarianceOfMean(biasSum_[0][c][i] + biasSum_[1][c][i], biasSumsq_[c][i], passes());
    });
  return out;
}

uint64_t Accumulator::passes() const {
  uint64_t n = 0;
  for (uint64_t c : count_) n += c;
  return n;
}

Rgb<float> Accumulator::meanOfBuckets(int first, int step) const {
  std::vector<const Rgb<double>*> used;
  uint64_t n = 0;
  for (size_t k = static_cast<size_t>(first); k < count_.size(); k += static_cast<size_t>(step)) {
    n += count_[k];
    used.push_back(&sum_[k]);
  }
  Rgb<float> out(width(), height());
  if (n == 0) return out;
  const auto width = static_cast<size_t>(squares_[0].width());
  parallelRows(height(), [&](int y) {
    const size_t begin = static_cast<size_t>(y) * width;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < begin + width; ++i) {
        double total = 0;
        for (const Rgb<double>* s : used) total += (*s)[c][i];
        out[c][i] = static_cast<float>(total / static_cast<double>(n));
      }
  });
  return out;
}

Rgb<float> Accumulator::mean() const { return meanOfBuckets(0, 1); }
Rgb<float> Accumulator::bucketMean(int k) const { return meanOfBuckets(k, bucketCount()); }
Rgb<float> Accumulator::halfMean(int half) const { return meanOfBuckets(half, 2); }

Rgb<float> Accumulator::passVariance() const {
  Rgb<float> out(width(), height());
  const uint64_t n = passes();
  const auto width = static_cast<size_t>(squares_[0].width());
  parallelRows(height(), [&](int y) {
    const size_t begin = static_cast<size_t>(y) * width;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < begin + width; ++i) {
        double total = 0;
        for (const Rgb<double>& s : sum_) total += s[c][i];
        double squares = 0;
        for (const Rgb<double>& s : squares_) squares += s[c][i];
        out[c][i] = floatVarianceOfMean(total, squares, n);
      }
  });
  return out;
}

// With K buckets that have passes, w_k = n_k / n and bucket means m_k: h = Σ w_k (m_k - mean)² / (K - 1). Unbiased when
// the variance of a bucket's mean goes as 1 / n_k; exactly Σ (m_k - mean)² / (K (K - 1)) for equal counts.
Plane<double> Accumulator::bucketVariance(size_t channel) const {
  std::vector<size_t> used;
  double n = 0;
  for (size_t k = 0; k < count_.size(); ++k)
    if (count_[k] > 0) {
      used.push_back(k);
      n += static_cast<double>(count_[k]);
    }
  Plane<double> out(width(), height());
  const auto width = static_cast<size_t>(squares_[0].width());
  parallelRows(height(), [&](int y) {
    const size_t begin = static_cast<size_t>(y) * width;
    for (size_t i = begin; i < begin + width; ++i) {
      double total = 0, spread = 0;
      for (size_t k : used) total += sum_[k][channel][i];
      for (size_t k : used) {
        const auto nk = static_cast<double>(count_[k]);
        spread += nk / n * sqr(sum_[k][channel][i] / nk - total / n);
      }
      out[i] = spread / static_cast<double>(used.size() - 1);
    }
  });
  return out;
}

Rgb<float> Accumulator::variance(bool lowDiscrepancy) const {
  Rgb<float> out = passVariance();
  const auto filled = std::count_if(count_.begin(), count_.end(), [](uint64_t n) { return n > 0; });
  const bool single = *std::max_element(count_.begin(), count_.end()) <= 1;
  if (!lowDiscrepancy || filled < 2 || single) return out;
  // Analysis of variance: the spread between K buckets is part of the spread of all n passes, so the ratio cannot
  // exceed this.
  const double ratioLimit = static_cast<double>(passes() - 1) / static_cast<double>(filled - 1);
  for (size_t c = 0; c < 3; ++c) {
    // Both boxes hold the same number of pixels, so sums do instead of averages; and sums of non-negative values, never
    // differences of running sums, so that a zero box is exactly zero and nothing absolute has to guard the division.
    const Plane<double> between = boxSum(bucketVariance(c), kVarianceBoxRadius);
    const Plane<double> within = boxSum(out[c], kVarianceBoxRadius);
    parallelChunks(out[c].size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const double ratio = within[i] > 0 ? std::min(between[i] / within[i], ratioLimit) : 0.0;
        out[c][i] = floatVariance(static_cast<double>(out[c][i]) * ratio);
      }
    });
  }
  return out;
}

}  // namespace braid
