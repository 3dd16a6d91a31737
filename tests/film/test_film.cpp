// SPDX-License-Identifier: Apache-2.0
// The film against direct sums, and its independence of order and threads.
#include <cmath>
#include <limits>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include "renderer/film/film.h"
#include "tests/film/film_passes.h"

namespace braid::test_film {

using namespace test::film_passes;

TEST_CASE("a rejected sample counts as zero") {
  PassTarget target(3, 2, {.splats = true});
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
    PassTarget target(5, 3, {});
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
    PassTarget target(3, 2, {.splats = true});
    splatAll(target, t == 0 ? 1 : 8);
    Accumulator film(3, 2, 2);
    film.commit(0, target);
    result[t] = film.mean();
  }
  CHECK(average(result[0]) > 100);
  CHECK(sameBits(result[0], result[1]));
}

TEST_CASE("large splats are clamped and counted, and never wrap") {
  PassTarget target(1, 1, {.splats = true});
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
    PassTarget target(4, 4, {.splats = true});
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
  PassTarget target(2, 2, {.features = true});
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
  FeatureAccumulator copy(2, 2);
  RawSums to, from;
  copy.listSums("", to);
  film.listSums("", from);
  addSums(to, from);
  copy.addCounts(film);
  CHECK(copy.variance(6).at(1, 0) == film.variance(6).at(1, 0));

  FeatureSample bad;
  bad.depth = std::numeric_limits<float>::infinity();
  target.features(0, 0, bad);
  CHECK(target.rejected() == 1);
  film.commit(6, target);
  CHECK(film.mean(6).at(0, 0) == 0);
}

}  // namespace braid::test_film
