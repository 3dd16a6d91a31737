// SPDX-License-Identifier: Apache-2.0
// The parts of walks through media: the phase function, free flights in three channels, and roulette.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/transport/random_walk.h"
#include "tests/support/statistics/chi_squared.h"

namespace braid::test_random_walk {

using namespace test;

namespace {

const Vec3 kDirection = glm::normalize(Vec3(0.3f, -0.5f, 0.8f));

// Mean and standard error of `draw(rng)` over many draws.
template <class Draw>
std::pair<double, double> meanOfDraws(const Draw& draw, uint64_t seed, int count = 100000) {
  Rng rng(seed);
  double sum = 0, squares = 0;
  for (int i = 0; i < count; ++i) {
    const double v = draw(rng);
    sum += v;
    squares += v * v;
  }
  const double mean = sum / count;
  return {mean, std::sqrt(std::max(0.0, squares / count - mean * mean) / (count - 1))};
}

}  // namespace

// A false alarm in 10⁴ choices of seeds, over all g.
TEST_CASE("random walk: directions follow the phase function of Henyey and Greenstein") {
  const float anisotropies[] = {-0.7f, 0, 0.5f, 0.9f};
  for (const float g : anisotropies) {
    CAPTURE(g);
    const ChiSquared result =
        chiSquared([&](Rng& rng) { return std::optional<Vec3>(sampleHenyeyGreenstein(kDirection, g, rng.next2())); },
                   [&](const Vec3& w) { return henyeyGreensteinPdfW(glm::dot(w, kDirection), g); }, 11);
    CHECK(result.pValue > sidak(1e-4, 4));
    CHECK(result.cells > 60);
    CHECK(result.integral == doctest::Approx(1).epsilon(1e-3));
    // A distribution of another anisotropy is told from it.
    CHECK(chiSquared([&](Rng& rng) { return std::optional<Vec3>(sampleHenyeyGreenstein(kDirection, g, rng.next2())); },
                     [&](const Vec3& w) { return henyeyGreensteinPdfW(glm::dot(w, kDirection), g + 0.05f); }, 11)
              .pValue < 1e-6);
  }
}

TEST_CASE("random walk: the mean cosine is g, also where nearly all light goes straight on or back") {
  for (const float g : {-0.9999f, -0.999f, -0.3f, 0.0f, 0.3f, 0.999f, 0.9999f}) {
    CAPTURE(g);
    const auto [mean, error] = meanOfDraws(
        [&](Rng& rng) {
          const Vec3 w = sampleHenyeyGreenstein(kDirection, g, rng.next2());
          CHECK(std::fabs(glm::length(w) - 1) < 1e-5f);
          return static_cast<double>(glm::dot(w, kDirection));
        },
        7);
    CHECK(std::fabs(mean - static_cast<double>(g)) < 4 * error + 1e-6);
  }
}

TEST_CASE("random walk: flights in grey have the mean free path and the distribution of Beer and Lambert") {
  const Spectrum extinction(4), channels(0.2f, 0.3f, 0.5f);
  const auto flight = [&](Rng& rng) {
    const Vec2 u = rng.next2();
    return static_cast<double>(sampleFlight(extinction, channels, u.x, u.y));
  };
  const auto [mean, error] = meanOfDraws(flight, 3);
  CHECK(std::fabs(mean - 0.25) < 4 * error);
  for (const double distance : {0.05, 0.25, 1.0}) {
    const auto [share, shareError] = meanOfDraws([&](Rng& rng) { return flight(rng) > distance ? 1.0 : 0.0; }, 4);
    CHECK(std::fabs(share - std::exp(-4 * distance)) < 4 * shareError);
  }
  CHECK(passageWeight(extinction, channels, 0.7f) == Spectrum(1));
  CHECK(collisionWeight(extinction, channels, 0.7f) == Spectrum(1));
}

// One of the channels meets nothing at all, another is a hundred times as dense as the third.
TEST_CASE("random walk: weights of flights are right in every channel and bounded by what the path carries") {
  const Spectrum extinction(0, 0.5f, 50);
  const Spectrum throughput(2, 1, 0.01f), channels = flightChannels(throughput);
  constexpr float kWall = 0.6f;
  for (int c = 0; c < 3; ++c) {
    CAPTURE(c);
    const double sigma = static_cast<double>(extinction[c]);
    const auto scattered = [&](Rng& rng, float from, float to) {
      const Vec2 u = rng.next2();
      const float t = sampleFlight(extinction, channels, u.x, u.y);
      return t >= from && t < to ? static_cast<double>(collisionWeight(extinction, channels, t)[c]) : 0.0;
    };
    const auto passed = [&](Rng& rng) {
      const Vec2 u = rng.next2();
      const bool passes = sampleFlight(extinction, channels, u.x, u.y) > kWall;
      return passes ? static_cast<double>(passageWeight(extinction, channels, kWall)[c]) : 0.0;
    };
    const auto [through, throughError] = meanOfDraws(passed, 5);
    CHECK(std::fabs(through - std::exp(-sigma * 0.6)) < 4 * throughError + 1e-6);
    for (const auto& [from, to] : {std::pair{0.0f, 0.02f}, {0.02f, 0.3f}, {0.3f, kWall}}) {
      const double expected = std::exp(-sigma * static_cast<double>(from)) - std::exp(-sigma * static_cast<double>(to));
      const auto [share, shareError] = meanOfDraws([&, a = from, b = to](Rng& rng) { return scattered(rng, a, b); }, 6);
      CHECK(std::fabs(share - expected) < 4 * shareError + 1e-6);
    }
  }
  Rng rng(9);
  const float carried = throughput.x + throughput.y + throughput.z;
  for (int i = 0; i < 1000; ++i) {
    const float t = 3 * rng.next();
    for (const Spectrum& weight : {passageWeight(extinction, channels, t), collisionWeight(extinction, channels, t)}) {
      const Spectrum after = throughput * weight;
      CHECK(after.x + after.y + after.z <= carried * 1.00001f);
    }
  }
}

TEST_CASE("random walk: media without extinction, and paths that carry nothing, end no flight and give no NaN") {
  CHECK(std::isinf(sampleFlight(Spectrum(0), Spectrum(1.0f / 3), 0.5f, 0.5f)));
  CHECK(flightChannels(Spectrum(0)) == Spectrum(1.0f / 3));
  CHECK(passageWeight({1e30f, 1, 0}, {1, 0, 0}, 1) == Spectrum(0));
  CHECK(isFinite(collisionWeight({1e30f, 1, 0}, {1, 0, 0}, 1e-30f)));
}

TEST_CASE("random walk: roulette keeps what carries much, and thins out long walks as the root of their length") {
  WalkState walk;
  walk.start = 2;
  walk.rays = 10;
  CHECK(RandomWalk::survivalOf(walk, 2) == 1);
  CHECK(RandomWalk::survivalOf(walk, 0.4f) == 1);
  CHECK(RandomWalk::survivalOf(walk, 0.1f) == doctest::Approx(0.25));
  CHECK(RandomWalk::survivalOf(walk, 0) == 0);
  double survival = 1;
  for (walk.rays = 1; walk.rays <= 16 * RandomWalk::kLong; ++walk.rays)
    survival *= static_cast<double>(RandomWalk::survivalOf(walk, 2));
  CHECK(survival == doctest::Approx(0.25).epsilon(1e-3));
  walk.rays = RandomWalk::kMostRays;
  CHECK(RandomWalk::survivalOf(walk, 2) == 0);
}

}  // namespace braid::test_random_walk
