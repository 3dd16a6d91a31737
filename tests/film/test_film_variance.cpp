// SPDX-License-Identifier: Apache-2.0
// The film's variances against known ones. Statistical checks have fixed seeds; each states how often a correct film
// would fail it under another seed.
#include <cmath>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "renderer/core/box_sum.h"
#include "renderer/film/film.h"
#include "tests/film/film_passes.h"

namespace braid::test_film_variance {

using namespace test::film_passes;

namespace {

double averageSquare(const Rgb<float>& image, double truth) {
  double sum = 0;
  for (const Plane<float>& p : image.channel)
    for (float v : p.data) sum += sqr(static_cast<double>(v) - truth);
  return sum / static_cast<double>(3 * image.size());
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
  PassTarget target(width, height, {});
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
    PassTarget target(40, 30, {});
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
  PassTarget target(64, 40, {});
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

}  // namespace braid::test_film_variance
