// SPDX-License-Identifier: Apache-2.0
// Random numbers: uniform, in the unit interval, stratified within a bucket, unrelated between buckets and pixels.
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "renderer/core/sampler.h"
#include "tests/support/statistics/chi_squared.h"
#include "tests/support/render_fixture.h"

namespace braid::test_sampler {

namespace {

constexpr uint64_t kStream = 0x7074;
constexpr SamplerKind kKinds[] = {SamplerKind::Independent, SamplerKind::Sobol};

// Counts of variates in equal cells against the uniform law; p-value.
class Histogram {
 public:
  explicit Histogram(size_t cells) : count_(cells, 0) {}
  void add(size_t cell) { ++count_[cell]; }
  double pValue() const {
    double total = 0, statistic = 0;
    for (const double n : count_) total += n;
    const double expected = total / static_cast<double>(count_.size());
    for (const double n : count_) statistic += sqr(n - expected) / expected;
    return test::gammaQ(0.5 * static_cast<double>(count_.size() - 1), 0.5 * statistic);
  }

 private:
  std::vector<double> count_;
};

size_t cellOf(float u, size_t cells) { return static_cast<size_t>(u * static_cast<float>(cells)); }

// Correlation of two streams of variates, in standard errors. The points of a bucket share their digits and differ in
// the scramble only, so what is independent is a whole group of points: the error comes from the spread of the groups.
class Relation {
 public:
  void add(float a, float b) { group_ += (static_cast<double>(a) - 0.5) * (static_cast<double>(b) - 0.5); }
  void endGroup() {
    sum_ += group_;
    sumOfSquares_ += sqr(group_);
    group_ = 0;
  }
  double z() const { return std::fabs(sum_) / std::sqrt(sumOfSquares_); }

 private:
  double group_ = 0, sum_ = 0, sumOfSquares_ = 0;
};

// The first 2^m points of a bucket in two dimensions of the camera's block.
std::vector<Vec2> bucketPoints(uint64_t bucket, uint64_t item, unsigned m, unsigned slotX, unsigned slotY) {
  std::vector<Vec2> points;
  for (uint64_t i = 0; i < (1u << m); ++i) {
    const PassSampler sampler(SamplerKind::Sobol, 7, kStream, kSequenceBuckets * i + bucket);
    const SampleBlock b = sampler.block(sampler.itemKey(item), 0);
    points.push_back({b.u[slotX], b.u[slotY]});
  }
  return points;
}

// Whether each elementary interval of area 2^-m holds exactly one of 2^m points.
bool isNet(const std::vector<Vec2>& points, unsigned m) {
  for (unsigned k = 0; k <= m; ++k) {
    const size_t columns = size_t(1) << k, rows = size_t(1) << (m - k);
    std::vector<int> count(points.size(), 0);
    for (const Vec2& p : points) ++count[cellOf(p.y, rows) * columns + cellOf(p.x, columns)];
    for (const int n : count)
      if (n != 1) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("sampler: every slot of every block is uniform over pixels") {
  // 12 blocks of 8 slots, two of the blocks past the table; false-alarm rate 10⁻⁴ for each kind.
  const unsigned blocks[] = {0, 1, 2, 3, 4, 7, 11, 15, 19, 23, 24, 40};
  for (const SamplerKind kind : kKinds) {
    double smallest = 1;
    std::vector<Histogram> histograms(std::size(blocks) * kBlockSize, Histogram(64));
    for (uint64_t pass = 0; pass < 8; ++pass) {
      const PassSampler sampler(kind, 3, kStream, pass);
      for (uint64_t item = 0; item < 4096; ++item)
        for (size_t b = 0; b < std::size(blocks); ++b) {
          const SampleBlock block = sampler.block(sampler.itemKey(item), blocks[b]);
          for (size_t s = 0; s < kBlockSize; ++s) histograms[b * kBlockSize + s].add(cellOf(block.u[s], 64));
        }
    }
    for (const Histogram& h : histograms) smallest = std::min(smallest, h.pValue());
    CHECK(smallest > test::sidak(1e-4, static_cast<int>(histograms.size())));
  }
}

TEST_CASE("sampler: one pixel's points are uniform over independent passes") {
  std::vector<Histogram> histograms(3 * kBlockSize, Histogram(64));
  for (uint64_t pass = 0; pass < 40000; ++pass) {
    const PassSampler sampler(SamplerKind::Independent, 5, kStream, pass);
    for (unsigned b = 0; b < 3; ++b) {
      const SampleBlock block = sampler.block(sampler.itemKey(1234), b);
      for (size_t s = 0; s < kBlockSize; ++s) histograms[b * kBlockSize + s].add(cellOf(block.u[s], 64));
    }
  }
  for (const Histogram& h : histograms) CHECK(h.pValue() > test::sidak(1e-4, 24));
}

TEST_CASE("sampler: pairs of slots fill the square evenly over pixels") {
  for (const SamplerKind kind : kKinds) {
    constexpr unsigned kPairs[][4] = {{0, slot::kPixelX, 0, slot::kPixelY}, {1, slot::kLightU, 1, slot::kLightV},
                                      {1, slot::kBsdfU, 1, slot::kBsdfV},   {2, slot::kBsdfU, 2, slot::kBsdfV},
                                      {1, slot::kBsdfU, 2, slot::kBsdfU},   {1, slot::kLobe, 1, slot::kRoulette},
                                      {24, slot::kBsdfU, 24, slot::kBsdfV}, {0, slot::kPixelX, 1, slot::kLightU}};
    const PassSampler sampler(kind, 9, kStream, 5);
    for (const auto& [blockA, slotA, blockB, slotB] : kPairs) {
      Histogram square(256);
      for (uint64_t item = 0; item < 30000; ++item) {
        const uint64_t key = sampler.itemKey(item);
        square.add(cellOf(sampler.block(key, blockA).u[slotA], 16) * 16 +
                   cellOf(sampler.block(key, blockB).u[slotB], 16));
      }
      CHECK(square.pValue() > test::sidak(1e-4, 16));
    }
  }
}

TEST_CASE("sampler: the points of a bucket are a net in the pixel's dimensions for every power of two") {
  for (uint64_t bucket = 0; bucket < kSequenceBuckets; ++bucket) {
    for (const uint64_t item : {0ull, 77ull, 921599ull}) {
      const std::vector<Vec2> points = bucketPoints(bucket, item, 8, slot::kPixelX, slot::kPixelY);
      for (unsigned m = 0; m <= 8; ++m) {
        CHECK(isNet(std::vector<Vec2>(points.begin(), points.begin() + (1 << m)), m));
        // So is every later run of that length.
        if (m < 8) CHECK(isNet(std::vector<Vec2>(points.begin() + (1 << m), points.begin() + (2 << m)), m));
      }
    }
  }
  // The check can fail: random points are no net.
  std::vector<Vec2> random;
  test::Rng rng(1);
  for (int i = 0; i < 64; ++i) random.push_back(rng.next2());
  CHECK(!isNet(random, 6));
}

TEST_CASE("sampler: every used slot of every tabulated block is stratified") {
  constexpr unsigned m = 6;
  std::vector<std::vector<SampleBlock>> blocks(24);
  for (uint64_t i = 0; i < (1u << m); ++i) {
    const PassSampler sampler(SamplerKind::Sobol, 11, kStream, kSequenceBuckets * i + 2);
    for (unsigned b = 0; b < 24; ++b) blocks[b].push_back(sampler.block(sampler.itemKey(5), b));
  }
  int unstratified = 0;
  for (const std::vector<SampleBlock>& points : blocks)
    for (size_t s = 0; s < kBlockSize; ++s) {
      std::vector<int> count(1u << m, 0);
      for (const SampleBlock& p : points) ++count[cellOf(p.u[s], 1u << m)];
      unstratified += *std::max_element(count.begin(), count.end()) != 1;
    }
  CHECK(unstratified == 0);
}

TEST_CASE("sampler: buckets, pixels, seeds and streams do not know of each other") {
  // 6 correlations for each kind; false-alarm rate 10⁻⁴ altogether.
  for (const SamplerKind kind : kKinds) {
    std::vector<PassSampler> own, nextBucket, otherSeed, otherStream;
    for (uint64_t i = 0; i < 32; ++i) {
      own.emplace_back(kind, 1, kStream, kSequenceBuckets * i);
      nextBucket.emplace_back(kind, 1, kStream, kSequenceBuckets * i + 1);
      otherSeed.emplace_back(kind, 2, kStream, kSequenceBuckets * i);
      otherStream.emplace_back(kind, 1, kStream + 1, kSequenceBuckets * i);
    }
    Relation relations[6];
    for (uint64_t item = 0; item < 4096; ++item)
      for (size_t s = 0; s < kBlockSize; ++s) {
        const auto at = [s](const PassSampler& p, uint64_t i, unsigned b) { return p.block(p.itemKey(i), b).u[s]; };
        for (size_t p = 0; p < own.size(); ++p) {
          const float u = at(own[p], item, 1);
          const float others[] = {at(nextBucket[p], item, 1), at(own[p], item + 1, 1),     at(own[p], item + 1280, 1),
                                  at(otherSeed[p], item, 1),  at(otherStream[p], item, 1), at(own[p], item, 2)};
          for (size_t i = 0; i < 6; ++i) relations[i].add(u, others[i]);
        }
        for (Relation& c : relations) c.endGroup();
      }
    for (const Relation& c : relations) CHECK(c.z() < test::zLimit(12));
  }
}

TEST_CASE("sampler: late passes and late blocks stay in the unit interval and stay uniform") {
  for (const SamplerKind kind : kKinds) {
    Histogram histogram(64);
    bool inside = true;
    for (uint64_t pass = 9'999'000; pass <= 10'000'000; pass += 10) {
      const PassSampler sampler(kind, 0, kStream, pass);
      for (const unsigned b : {0u, 1u, 23u, 24u, 500u, 100000u})
        for (uint64_t item = 0; item < 32; ++item)
          for (const float u : sampler.block(sampler.itemKey(item), b).u) {
            inside = inside && u >= 0 && u < 1;
            histogram.add(std::min(cellOf(u, 64), size_t(63)));
          }
    }
    CHECK(inside);
    CHECK(histogram.pValue() > 1e-4);
  }
}

TEST_CASE("sampler: blocks past the table differ from pass to pass of a bucket") {
  Relation z;
  int equal = 0;
  const PassSampler first(SamplerKind::Sobol, 0, kStream, 0), second(SamplerKind::Sobol, 0, kStream, kSequenceBuckets);
  for (uint64_t item = 0; item < 10000; ++item) {
    const SampleBlock a = first.block(first.itemKey(item), 30), b = second.block(second.itemKey(item), 30);
    for (size_t s = 0; s < kBlockSize; ++s) {
      z.add(a.u[s], b.u[s]);
      z.endGroup();
      equal += a.u[s] == b.u[s];
    }
  }
  CHECK(z.z() < 4.0);
  CHECK(equal < 5);
}

TEST_CASE("sampler: the same arguments give the same numbers, the salt differs from ray to ray") {
  const PassSampler a(SamplerKind::Sobol, 4, kStream, 123), b(SamplerKind::Sobol, 4, kStream, 123);
  CHECK(a.block(a.itemKey(9), 3).u == b.block(b.itemKey(9), 3).u);
  Histogram salts(64);
  for (uint64_t item = 0; item < 4000; ++item)
    for (uint32_t ray = 1; ray < 5; ++ray) salts.add(a.salt(a.itemKey(item), ray) >> 26);
  CHECK(salts.pValue() > 1e-4);
  CHECK(a.salt(a.itemKey(9), 1) != a.salt(a.itemKey(9), 2));
}

}  // namespace braid::test_sampler
