// SPDX-License-Identifier: Apache-2.0
// The film against direct sums, its variances against known ones, and its independence of order and threads.
// Statistical checks have fixed seeds; each states how often a correct film would fail it under another seed.
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include "renderer/film/box_sum.h"
#include "renderer/film/film.h"

namespace braid::test_film {

namespace {

bool sameBits(const Rgb<float>& a, const Rgb<float>& b) {
  for (size_t c = 0; c < 3; ++c)
    if (a[c].size() != b[c].size() || std::memcmp(a[c].data.data(), b[c].data.data(), 4 * a[c].size()) != 0)
      return false;
  return true;
}

double average(const Rgb<float>& image) {
  double sum = 0;
  for (const Plane<float>& p : image.channel)
    for (float v : p.data) sum += static_cast<double>(v);
  return sum / static_cast<double>(3 * image.size());
}

double averageSquare(const Rgb<float>& image, double truth) {
  double sum = 0;
  for (const Plane<float>& p : image.channel)
    for (float v : p.data) sum += sqr(static_cast<double>(v) - truth);
  return sum / static_cast<double>(3 * image.size());
}

// Passes of independent uniform variates in [0, 1).
Accumulator uniformPasses(int width, int height, int buckets, uint64_t passes, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> u;
  Accumulator film(width, height, buckets);
  PassTarget target(width, height, false, false);
  for (uint64_t pass = 0; pass < passes; ++pass) {
    target.clear();
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) target.add(x, y, Spectrum(u(random), u(random), u(random)));
    film.commit(pass, target);
  }
  return film;
}

// Van der Corput points of one bucket, shifted per pixel, channel and bucket: a low-discrepancy sampler with
// independent scrambles.
float radicalInverse(uint64_t i) {
  float value = 0, digit = 0.5f;
  for (; i > 0; i >>= 1, digit /= 2)
    if (i & 1) value += digit;
  return value;
}

Accumulator stratifiedPasses(int width, int height, uint64_t passes, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> u;
  std::vector<Rgb<float>> shift(4, Rgb<float>(width, height));
  for (Rgb<float>& s : shift)
    for (Plane<float>& p : s.channel)
      for (float& v : p.data) v = u(random);
  Accumulator film(width, height, 4);
  PassTarget target(width, height, false, false);
  for (uint64_t pass = 0; pass < passes; ++pass) {
    const float point = radicalInverse(pass / 4);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const Vec3 v = shift[pass % 4].pixel(shift[0][0].index(x, y)) + point;
        target.add(x, y, glm::fract(v));
      }
    film.commit(pass, target);
  }
  return film;
}

Accumulator onePixel(std::vector<double> sums, double sumOfSquares, uint64_t passes) {
  std::vector<Rgb<double>> planes;
  std::vector<uint64_t> counts(sums.size(), passes / sums.size());
  for (double s : sums) planes.emplace_back(1, 1, s);
  return Accumulator::fromSums(std::move(planes), Rgb<double>(1, 1, sumOfSquares), std::move(counts), 0, 0);
}

}  // namespace

TEST_CASE("a rejected sample counts as zero") {
  PassTarget target(3, 2, true, false);
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  CHECK(target.add(0, 0, Spectrum(1, 2, 3)));
  CHECK_FALSE(target.add(1, 0, Spectrum(1, nan, 3)));
  CHECK_FALSE(target.add(2, 0, Spectrum(inf, 0, 0)));
  CHECK_FALSE(target.add(0, 1, Spectrum(0, 0, -1e-6f)));
  CHECK_FALSE(target.splat(0, 0, Spectrum(nan, 0, 0)));
  CHECK_FALSE(target.splat(0, 0, Spectrum(0, -1, 0)));
  CHECK(target.splat(2, 1, Spectrum(0.5f, 0.25f, 0)));
  CHECK(target.rejected() == 5);
  Accumulator film(3, 2, 2);
  film.commit(0, target);
  target.clear();
  film.commit(1, target);
  CHECK(film.rejected() == 5);
  CHECK(film.passes() == 2);
  const Rgb<float> mean = film.mean();
  CHECK(mean.pixel(0) == Vec3(0.5f, 1, 1.5f));
  CHECK(mean.pixel(1) == Vec3(0));
  CHECK(mean.pixel(5) == Vec3(0.25f, 0.125f, 0));
  CHECK(film.halfMean(0).pixel(0) == Vec3(1, 2, 3));
  CHECK(film.halfMean(1).pixel(0) == Vec3(0));
}

TEST_CASE("buckets, halves and mean are what direct sums give") {
  for (int buckets : {2, 4}) {
    Accumulator film(5, 3, buckets);
    PassTarget target(5, 3, false, false);
    for (uint64_t pass = 0; pass < 11; ++pass) {
      for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 5; ++x)
          target.add(x, y, Spectrum(static_cast<float>(pass * pass + static_cast<uint64_t>(x + y))));
      film.commit(pass, target);
    }
    for (int k = 0; k < buckets; ++k) {
      double sum = 0, n = 0;
      for (int pass = k; pass < 11; pass += buckets, ++n) sum += pass * pass + 6;
      CHECK(film.passesInBucket(k) == static_cast<uint64_t>(n));
      CHECK(film.bucketMean(k)[1].at(4, 2) == doctest::Approx(sum / n));
    }
    CHECK(film.halfMean(0)[2].at(0, 0) == doctest::Approx((4 + 16 + 36 + 64 + 100) / 6.0));
    CHECK(film.halfMean(1)[2].at(0, 0) == doctest::Approx((1 + 9 + 25 + 49 + 81) / 5.0));
    CHECK(film.mean()[0].at(0, 0) == doctest::Approx(385 / 11.0));
  }
}

TEST_CASE("an empty film is zero everywhere") {
  const Accumulator film(4, 4, 4);
  CHECK(average(film.mean()) == 0);
  CHECK(average(film.halfMean(1)) == 0);
  CHECK(average(film.bucketMean(3)) == 0);
  CHECK(average(film.variance(true)) == 0);
}

TEST_CASE("splats do not depend on order or threads") {
  const auto splatAll = [](PassTarget& target, size_t threads) {
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    tbb::parallel_for(0, 20000, [&](int i) {
      const float v = 1e-3f * static_cast<float>(i % 977) + 1e-7f * static_cast<float>(i);
      target.splat(i % 3, i % 2, Spectrum(v, 3 * v, 1 / (1 + v)));
    });
  };
  Rgb<float> result[2];
  for (size_t t : {0, 1}) {
    PassTarget target(3, 2, true, false);
    splatAll(target, t == 0 ? 1 : 8);
    Accumulator film(3, 2, 2);
    film.commit(0, target);
    result[t] = film.mean();
  }
  CHECK(average(result[0]) > 100);
  CHECK(sameBits(result[0], result[1]));
}

TEST_CASE("large splats are clamped and counted, and never wrap") {
  PassTarget target(1, 1, true, false);
  for (int i = 0; i < 600; ++i) target.splat(0, 0, Spectrum(1e9f, 4194304.0f, 1));
  CHECK(target.clampedSplats() == 600);
  Accumulator film(1, 1, 2);
  film.commit(0, target);
  CHECK(film.clampedSplats() == 600);
  CHECK(film.mean()[0][0] == doctest::Approx(2147483648.0));
  CHECK(film.mean()[2][0] == 600.0f);
}

TEST_CASE("the fixed point of splats follows the scale of the light") {
  Rgb<float> result[3];
  const int shifts[3] = {0, -30, 30};
  for (size_t k = 0; k < 3; ++k) {
    PassTarget target(4, 4, true, false);
    target.setSplatFractionBits(32 - shifts[k]);
    for (int i = 0; i < 1000; ++i) {
      const float v = std::ldexp(0.37f + 1e-3f * static_cast<float>(i), shifts[k]);
      CHECK(target.splat(i % 4, i % 3, Spectrum(v)));
    }
    CHECK(target.clampedSplats() == 0);
    Accumulator film(4, 4, 2);
    film.commit(0, target);
    result[k] = film.mean();
    for (Plane<float>& p : result[k].channel)
      for (float& v : p.data) v = std::ldexp(v, -shifts[k]);
  }
  CHECK(sameBits(result[0], result[1]));
  CHECK(sameBits(result[0], result[2]));
}

TEST_CASE("the variance of the mean is unbiased") {
  // 12288 independent estimates from 16 passes: relative standard deviation 0.0022; 1 % fails a correct film once in
  // 10^5 seeds.
  const Accumulator film = uniformPasses(64, 64, 2, 16, 1);
  const double truth = 1.0 / 12 / 16;
  CHECK(average(film.passVariance()) == doctest::Approx(truth).epsilon(0.01));
  // The error itself: relative standard deviation 0.013; 6 % fails once in 10^5 seeds.
  CHECK(averageSquare(film.mean(), 0.5) == doctest::Approx(truth).epsilon(0.06));
  CHECK(sameBits(film.passVariance(), film.variance(false)));
}

TEST_CASE("a constant has no variance, however many passes") {
  for (float v : {0.1f, 1.0f, 3.3e-12f, 7.7e12f}) {
    double sum = 0, sumOfSquares = 0;
    const double d = static_cast<double>(v);
    for (uint64_t n = 1; n <= 10'000'000; ++n) {
      sum += d / 2;
      sumOfSquares += d * d;
      if (n == 2 || n == 64 || n == 1'000'000 || n == 10'000'000)
        CHECK(average(onePixel({sum, sum}, sumOfSquares, n).passVariance()) == 0);
    }
  }
}

TEST_CASE("the variance keeps its digits after ten million passes") {
  // A relative standard deviation of one pass of 1, 0.1 and 0.01; the truth from long double in two steps.
  for (double deviation : {1.0, 0.1, 0.01}) {
    std::mt19937_64 random(7);
    std::uniform_real_distribution<float> u(static_cast<float>(1 - deviation), static_cast<float>(1 + deviation));
    const uint64_t n = 10'000'000;
    double sum[2] = {0, 0}, sumOfSquares = 0;
    long double exact = 0, exactSquares = 0;
    for (uint64_t i = 0; i < n; ++i) {
      const double v = static_cast<double>(u(random));
      sum[i % 2] += v;
      sumOfSquares += v * v;
      exact += v - 1.0L;
      exactSquares += (v - 1.0L) * (v - 1.0L);
    }
    const long double count = n;
    const long double truth = (exactSquares / count - (exact / count) * (exact / count)) / (count - 1);
    const Accumulator film = onePixel({sum[0], sum[1]}, sumOfSquares, n);
    CHECK(static_cast<double>(film.passVariance()[0][0]) == doctest::Approx(static_cast<double>(truth)).epsilon(1e-6));
    CHECK(static_cast<double>(film.mean()[0][0]) ==
          doctest::Approx(static_cast<double>(1 + exact / count)).epsilon(1e-7));
  }
}

TEST_CASE("low-discrepancy variance is calibrated") {
  // Reported over empirical: the quotient of two averages over 18432 independent values, relative standard deviation
  // 0.014; 10 % fails a correct film less than once in 10^9 seeds.
  for (uint64_t passes : {32, 64}) {
    const Accumulator film = stratifiedPasses(96, 64, passes, 3);
    const double empirical = averageSquare(film.mean(), 0.5);
    const double reported = average(film.variance(true));
    CHECK(reported / empirical > 0.9);
    CHECK(reported / empirical < 1.1);
    CHECK(average(film.passVariance()) > 5 * empirical);
  }
}

TEST_CASE("low-discrepancy variance of independent passes is calibrated, with equal and unequal buckets") {
  // As above: relative standard deviation of the quotient below 0.016.
  for (uint64_t passes : {5, 17, 32, 35}) {
    const Accumulator film = uniformPasses(96, 64, 4, passes, 5 + static_cast<unsigned>(passes));
    const double truth = 1.0 / 12 / static_cast<double>(passes);
    CHECK(average(film.variance(true)) / truth == doctest::Approx(1).epsilon(0.1));
  }
}

TEST_CASE("low-discrepancy variance falls back to the passes when buckets say nothing") {
  for (uint64_t passes : {1, 2, 4}) {
    const Accumulator film = uniformPasses(8, 8, 4, passes, 9);
    CHECK(sameBits(film.variance(true), film.passVariance()));
  }
}

TEST_CASE("low-discrepancy variance scales with the square of the light") {
  Accumulator films[2] = {Accumulator(40, 30, 4), Accumulator(40, 30, 4)};
  for (int k = 0; k < 2; ++k) {
    std::mt19937 random(11);
    std::uniform_real_distribution<float> u;
    PassTarget target(40, 30, false, false);
    for (uint64_t pass = 0; pass < 16; ++pass) {
      for (int y = 0; y < 30; ++y)
        for (int x = 0; x < 40; ++x) target.add(x, y, std::ldexp(u(random), k * -20) * Spectrum(1));
      films[k].commit(pass, target);
    }
  }
  const Rgb<float> a = films[0].variance(true), b = films[1].variance(true);
  for (size_t i = 0; i < a.size(); ++i) CHECK(std::ldexp(a[0][i], -40) == b[0][i]);
}

TEST_CASE("a black region beside fireflies keeps a variance of exactly zero") {
  Accumulator film(64, 40, 4);
  std::mt19937 random(13);
  std::uniform_real_distribution<float> u;
  PassTarget target(64, 40, false, false);
  for (uint64_t pass = 0; pass < 8; ++pass) {
    for (int y = 0; y < 40; ++y)
      for (int x = 0; x < 16; ++x) target.add(x, y, Spectrum(1e10f * u(random)));
    film.commit(pass, target);
  }
  const Rgb<float> v = film.variance(true);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 64; ++x) {
      CHECK(std::isfinite(v[0].at(x, y)));
      CHECK((v[0].at(x, y) > 0) == (x < 16));
    }
}

TEST_CASE("box sums equal direct sums") {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> u;
  for (auto [width, height] :
       {std::pair(1, 1), std::pair(3, 50), std::pair(130, 7), std::pair(21, 21), std::pair(64, 43)}) {
    Plane<double> in(width, height);
    for (double& v : in.data) v = u(random);
    const Plane<double> out = boxSum(in, 10);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        double sum = 0;
        for (int j = std::max(0, y - 10); j <= std::min(height - 1, y + 10); ++j)
          for (int i = std::max(0, x - 10); i <= std::min(width - 1, x + 10); ++i) sum += in.at(i, j);
        REQUIRE(out.at(x, y) == doctest::Approx(sum).epsilon(1e-12));
      }
  }
}

TEST_CASE("film results do not depend on threads") {
  Rgb<float> variance[2], mean[2];
  for (size_t k : {0, 1}) {
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, k == 0 ? 1 : 8);
    const Accumulator film = uniformPasses(131, 67, 4, 9, 19);
    variance[k] = film.variance(true);
    mean[k] = film.mean();
  }
  CHECK(sameBits(variance[0], variance[1]));
  CHECK(sameBits(mean[0], mean[1]));
}

TEST_CASE("a film made from its sums is the same film") {
  const Accumulator a = uniformPasses(9, 7, 4, 6, 23);
  const Accumulator b =
      Accumulator::fromSums(a.sums(), a.sumOfSquares(), {2, 2, 1, 1}, a.rejected(), a.clampedSplats());
  CHECK(sameBits(a.mean(), b.mean()));
  CHECK(sameBits(a.halfMean(1), b.halfMean(1)));
  CHECK(sameBits(a.variance(true), b.variance(true)));
}

TEST_CASE("features: mean, halves and variance") {
  FeatureAccumulator film(2, 2);
  PassTarget target(2, 2, false, true);
  CHECK(target.wantsFeatures());
  for (uint64_t pass = 0; pass < 6; ++pass) {
    const float v = static_cast<float>(pass);
    FeatureSample s;
    s.albedo = Spectrum(0.5f);
    s.normal = Vec3(-1, 0, v);
    s.depth = 10 * v;
    s.visibility = pass % 2 == 0 ? 1.0f : 0.0f;
    target.features(1, 0, s);
    film.commit(pass, target);
  }
  CHECK(film.passes() == 6);
  CHECK(film.mean(0).at(1, 0) == 0.5f);
  CHECK(film.mean(0).at(0, 1) == 0);
  CHECK(film.mean(3).at(1, 0) == -1);
  CHECK(film.mean(5).at(1, 0) == 2.5f);
  CHECK(film.halfMean(5, 0).at(1, 0) == 2);
  CHECK(film.halfMean(5, 1).at(1, 0) == 3);
  CHECK(film.halfMean(7, 0).at(1, 0) == 1);
  CHECK(film.halfMean(7, 1).at(1, 0) == 0);
  CHECK(film.variance(3).at(1, 0) == 0);
  // Values 0, 10 … 50: variance of one pass 350, of the mean 350 / 6.
  CHECK(film.variance(6).at(1, 0) == doctest::Approx(350.0 / 6));
  const FeatureAccumulator copy = FeatureAccumulator::fromSums(film.sums(0), film.sums(1), film.sumsOfSquares(), 3, 3);
  CHECK(copy.variance(6).at(1, 0) == film.variance(6).at(1, 0));

  FeatureSample bad;
  bad.depth = std::numeric_limits<float>::infinity();
  target.features(0, 0, bad);
  CHECK(target.rejected() == 1);
  film.commit(6, target);
  CHECK(film.mean(6).at(0, 0) == 0);
}

}  // namespace braid::test_film
