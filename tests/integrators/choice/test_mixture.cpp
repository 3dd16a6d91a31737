// SPDX-License-Identifier: Apache-2.0
// The rule that chooses a mixture of integrators, on given numbers; and what it reads of images.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/core/sampler.h"
#include "renderer/session/mixture/mixture.h"
#include "renderer/session/mixture/pilot_blocks.h"

namespace braid::test_mixture {

namespace {

constexpr double kSamples = 64;
const std::vector<Mixture> kAlone{{0, 1}, {0}};  // beside a photon map, which is present; and alone

// An unbiased integrator and a photon map, with the same numbers in all of 64 blocks.
std::vector<PilotMeasure> measures(const PilotBlock& unbiased, const PilotBlock& photons, double photonCost = 2) {
  return {{true, 2, 8, 0, std::vector<PilotBlock>(64, unbiased)},
          {false, photonCost, 8, 0, std::vector<PilotBlock>(64, photons)}};
}

size_t best(const std::vector<PilotMeasure>& m) { return chooseMixture(kAlone, 0, m, kSamples).best; }

}  // namespace

TEST_CASE("Alone the expected error falls as the cost rises, and counts fireflies more than even noise") {
  const auto even = measures({1, 1, 0, 0}, {1, 0, 0, 0}), fireflies = measures({1, 0, 1, 0}, {1, 0, 0, 0});
  const double error = expectedError({0}, even, 128);
  CHECK(error > 0);
  CHECK(expectedError({0}, even, 256) == doctest::Approx(error / 2));
  CHECK(expectedError({0}, fireflies, 128) > 2 * error);
  auto hidden = even;
  hidden[0].hidden = 0.5;
  CHECK(expectedError({0}, hidden, 128) == doctest::Approx(error + 0.5));
  const double beside = expectedError({0, 1}, hidden, 128) - expectedError({0, 1}, even, 128);
  CHECK(beside > 0);
  CHECK(beside < 0.5 / 10);  // the photon map has it
}

TEST_CASE("A photon map is kept where fireflies lead, and left out where its bias is all that it adds") {
  CHECK(best(measures({1, 0.2f, 50, 0}, {1, 0.5f, 0.1f, 0.001f})) == 0);
  CHECK(best(measures({1, 1, 0.1f, 0}, {1, 0.5f, 0.1f, 0.05f})) == 1);
  CHECK(best(measures({1, 1, 0.1f, 0}, {1, 20, 0.1f, 0})) == 1);  // noisier than what it stands beside
}

TEST_CASE("The choice knows what passes cost") {
  const PilotBlock noisy{1, 1, 3, 0}, map{1, 0.5f, 0, 0};
  CHECK(best(measures(noisy, map, 0.1)) == 0);
  CHECK(best(measures(noisy, map, 100)) == 1);
}

TEST_CASE("What is present stays unless the gain is beyond the margin and beyond doubt") {
  const std::vector<Mixture> either{{0}, {1}};
  auto m = measures({1, 1, 0, 0}, {1, 1, 0, 0}, 2 * 0.97);
  m[1].unbiased = true;
  CHECK(chooseMixture(either, 0, m, kSamples).best == 0);
  m[1].cost = 2 * 0.9;
  CHECK(chooseMixture(either, 0, m, kSamples).best == 1);
  // One block speaks for the change, and all others against it.
  m[1].cost = 2;
  m[0].blocks.assign(64, {1, 1e-4f, 0, 0});
  m[1].blocks.assign(64, {1, 2e-4f, 0, 0});
  m[0].blocks[5] = {1, 1, 0, 0};
  m[1].blocks[5] = {1, 0.5f, 0, 0};
  const MixtureChoice choice = chooseMixture(either, 0, m, kSamples);
  CHECK(choice.error[1] < choice.error[0] / kMixturePays);
  CHECK(choice.uncertainty[1] > 1);
  CHECK(choice.best == 0);
}

TEST_CASE("Of two mixtures that are equal within the pilot's doubt, the one without photons is taken") {
  const std::vector<Mixture> three{{0, 2}, {1, 2}, {0}};
  CHECK(bestOf(three, 0, {1, 0.5, 0.53}, {0, 0.1, 0.1}) == 2);
  CHECK(bestOf(three, 0, {1, 0.5, 0.7}, {0, 0.1, 0.1}) == 1);
  CHECK(bestOf(three, 0, {1, 0.5, 0.53}, {0, 0.01, 0.01}) == 1);
  CHECK(bestOf(three, 0, {1, 0.96, 0.97}, {0, 0.001, 0.001}) == 0);  // below the margin
  CHECK(bestOf(three, 0, {1, 0.7, 0.6}, {0, 0.1, 0.9}) == 1);        // beyond doubt
}

TEST_CASE("Light that only the photon map has counts as an error of paths that have not met it") {
  const PilotBlock dark{0.8f, 0.1f, 0, 0}, full{1, 0.02f, 0, 0};
  const auto m = measures(dark, full);
  CHECK(expectedError({0}, m, 1e9) == doctest::Approx(0.04));  // however long it renders
  CHECK(expectedError({0, 1}, m, 1e9) < 0.001);
  CHECK(best(m) == 0);
  // Where the map's own noise explains the difference, nothing is missed.
  CHECK(expectedError({0}, measures(dark, {1, 1, 0, 0}), 1e9) < 1e-6);
}

TEST_CASE("Black images leave the choice as it is") {
  const MixtureChoice choice = chooseMixture(kAlone, 0, measures({}, {}), kSamples);
  CHECK(choice.best == 0);
  for (const double error : choice.error) CHECK(error == 0);
}

TEST_CASE("Blocks hold the variance of one pass relative to their brightness, and fireflies apart") {
  constexpr int kSide = 32, kPasses = 8;
  Accumulator sums(kSide, kSide, 4);
  const PassSampler sampler(SamplerKind::Independent, 1, 2, 0, 1);
  for (uint64_t pass = 0; pass < kPasses; ++pass) {
    Rgb<float> values(kSide, kSide);
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) {
        const uint64_t item = (pass * kSide + static_cast<uint64_t>(y)) * kSide + static_cast<uint64_t>(x);
        const float u = sampler.block(sampler.itemKey(item), 0).u[0];
        const bool firefly = x >= 16 && x % 4 == 1 && y % 4 == 2 && pass == 3;
        for (size_t c = 0; c < 3; ++c) values[c].at(x, y) = firefly ? 200.0f : 1.5f + u;
      }
    sums.commit(pass, values);
  }
  const std::vector<float> scales = blockScales({&sums});
  const std::vector<PilotBlock> blocks = blocksOf(sums, false, scales, 1);
  REQUIRE(blocks.size() == 64);
  double quiet = 0;
  for (size_t b = 0; b < blocks.size(); ++b) {
    CHECK(blocks[b].bias == 0);
    if (b % 8 >= 4)
      CHECK(blocks[b].fireflies > 10 * blocks[b].noise);
    else
      quiet += static_cast<double>((blocks[b].noise + blocks[b].fireflies) / scales[b]) / 32;
  }
  // 4096 uniform variates, whose sample variance has a relative standard deviation of 1.4 %.
  CHECK(quiet == doctest::Approx(1.0 / 12).epsilon(0.06));
}

}  // namespace braid::test_mixture
