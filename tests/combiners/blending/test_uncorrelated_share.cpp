// SPDX-License-Identifier: Apache-2.0
// How much of the uncorrelated combination is taken: what its halves show to be of use.
#include <cmath>
#include <string>

#include <doctest/doctest.h>

#include "combiners/pixels/mirror.h"
#include "combiners/pixels/plane_mean.h"
#include "combiners/pipeline/registry.h"
#include "combiners/statistics/residual_scale.h"
#include "combiners/uncorrelated/uncorrelated_share.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_uncorrelated_share {

using namespace test;

namespace {

// y + factor (e - y), where e has errors like those of y but independent of them.
Rgb<float> mixedHalf(const Case& c, const Case& other, size_t h, float factor) {
  Rgb<float> out = c.pt().half[h];
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < out.size(); ++i) {
      const float e = c.truth[k][i] + 3 * (other.pt().half[h][k][i] - c.truth[k][i]);
      out[k][i] += factor * (e - out[k][i]);
    }
  return out;
}

MethodResult run(const Case& c, double measured) {
  MethodInputs in = inputsOf(c);
  in.options.set("uncorrelated-measured", measured);
  return make_uncorrelated()->run(in);
}

// What a strong sample in one pixel adds.
struct Added {
  // To the light of the image, mean over channels and runs: where the share rises, the offset that the noise of the
  // correlated image has in common changes sides, too.
  double light = 0;
  double peak = 0, highestPeak = 0;  // what the pixel has: mean over channels and runs, and most
};

Added addedBy(CaseOptions o, size_t image, float excess) {
  constexpr int kRuns = 16;
  Added added;
  for (int r = 0; r < kRuns; ++r) {
    o.seed = 1 + static_cast<uint64_t>(r);
    const MethodResult without = run(makeCase(o), 1);
    Case c = makeCase(o);
    Estimate& e = c.estimates.estimates[image];
    for (size_t k = 0; k < 3; ++k) {
      e.mean[k].at(32, 32) += excess;
      e.half[0][k].at(32, 32) += 2 * excess;
      e.quarter[0][k].at(32, 32) += 4 * excess;
      e.variance[k].at(32, 32) += excess * excess;
    }
    const MethodResult with = run(c, 1);
    for (size_t k = 0; k < 3; ++k) {
      added.light +=
          (planeMean(with.image.mean[k]) - planeMean(without.image.mean[k])) * o.width * o.height / (3 * kRuns);
      const auto peak = static_cast<double>(with.image.mean[k].at(32, 32));
      added.peak += peak / (3 * kRuns);
      added.highestPeak = std::max(added.highestPeak, peak);
    }
  }
  return added;
}

}  // namespace

TEST_CASE("The share is that of the best mean: all of what is better, a tenth of three times the deviation") {
  CaseOptions o;
  o.width = o.height = 96;
  o.constant = 1;
  const Case c = makeCase(o);
  o.seed = 2;
  const Case other = makeCase(o);
  const Estimate& y = c.pt();
  const Rgb<float> exact[2] = {c.truth, c.truth}, same[2] = {y.half[0], y.half[1]};
  const Rgb<float> worse[2] = {mixedHalf(c, other, 0, 1), mixedHalf(c, other, 1, 1)};
  const Rgb<float> mixed[2] = {mixedHalf(c, other, 0, 0.05f), mixedHalf(c, other, 1, 0.05f)};
  for (size_t k = 0; k < 3; ++k) {
    CHECK(planeMean(combinedShares({y, y}, exact, y.variance)[k]) == doctest::Approx(1));
    CHECK(planeMean(combinedShares({y, y}, same, y.variance)[k]) == 1);
    // Of 225 pairs of samples each; a regression's own noise bends clamped shares by less than the tolerance.
    CHECK(planeMean(combinedShares({y, y}, worse, y.variance)[k]) == doctest::Approx(0.1).epsilon(0.2));
    CHECK(planeMean(combinedShares({y, y}, worse, {})[k]) == doctest::Approx(0.1).epsilon(0.2));
    // The best mean has a tenth of the other image, twice of what is in it.
    CHECK(planeMean(combinedShares({y, y}, mixed, y.variance)[k]) > 0.9);
  }
}

// The deviation of pixels is that of pt, or `factor` times it for the correlated image, and every pixel has noise of
// its own: differences are no better than pixels.
Case withoutCorrelation(uint64_t seed, double noise, double factor) {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.seed = seed;
  o.noise = noise;
  Case c = makeCase(o);
  o.seed = seed + 10;
  o.noise = noise * factor;
  Estimate& z = c.estimates.estimates[1];
  z = makeCase(o).pt();
  z.name = "crn";
  z.correlation = Correlation::CommonRandomNumbers;
  return c;
}

TEST_CASE("A correlated image that is much noisier does no harm") {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const Case c = withoutCorrelation(seed, 0.25, 16);
    const auto errorOf = [&](const MethodResult& r) { return meanSquaredError(r.image.mean, c.truth); };
    const double all = errorOf(run(c, 0)), measured = errorOf(run(c, 1)),
                 alone = meanSquaredError(c.pt().mean, c.truth);
    MESSAGE("squared error of all ", all, ", measured ", measured, ", independent image ", alone);
    CHECK(measured < 1.02 * alone);
    CHECK(all > 2 * alone);
  }
}

TEST_CASE("The plain mean weighs both images by their noise, whatever single fireflies say") {
  for (const double factor : {0.5, 1.0, 2.0}) {
    Case c = withoutCorrelation(1, 1, factor);
    Estimate& y = c.estimates.estimates[0];
    for (size_t k = 0; k < 3; ++k) y.quarter[0][k].at(40, 40) += 1e4f;
    const double expected = 1 / (1 + sqr(factor));
    for (const double weight : plainMean(y, c.crn()).weight) CHECK(weight == doctest::Approx(expected).epsilon(0.05));
  }
  const Case c = withoutCorrelation(1, 1, 1);
  const PlainMean mean{c.pt(), c.crn(), {0.25, 0.25, 0.25}};
  Rgb<float> combined = c.truth;
  takeShare(combined, mean, c.pt().mean, c.crn().mean,
            {Plane<float>(96, 72), Plane<float>(96, 72), Plane<float>(96, 72)});
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < combined.size(); ++i)
      CHECK(combined[k][i] == doctest::Approx(0.75f * c.pt().mean[k][i] + 0.25f * c.crn().mean[k][i]));
}

// Two images that are equally good have half the error in the mean.
TEST_CASE("Where the combination is not to be had, the noise of both images is averaged") {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const Case c = withoutCorrelation(seed, 1, 1);
    MethodInputs in = inputsOf(c);
    in.options.set("uncorrelated-gamma", 0);  // all neighbours: no noise of y, all noise of z
    const double error = meanSquaredError(make_uncorrelated()->run(in).image.mean, c.truth),
                 alone = std::min(meanSquaredError(c.pt().mean, c.truth), meanSquaredError(c.crn().mean, c.truth));
    MESSAGE("squared error ", error, ", better input ", alone);
    CHECK(error < 0.6 * alone);
  }
}

TEST_CASE("The sign of the differences does not matter, and images that agree stay what they are") {
  const Case c = makeCase();
  Estimate swapped = c.pt();
  std::swap(swapped.half[0], swapped.half[1]);
  const Rgb<float> x[2] = {c.crn().half[0], c.crn().half[1]}, back[2] = {x[1], x[0]};
  const auto a = combinedShares({c.pt(), c.crn()}, x, c.pt().variance),
             b = combinedShares({swapped, c.crn()}, back, c.pt().variance);
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < a[k].size(); ++i) {
      CHECK(a[k][i] == b[k][i]);
      CHECK((a[k][i] >= 0 && a[k][i] <= 1));
    }
}

TEST_CASE("Levels of units are those of the pixels around, or of the ones that are alike in noise") {
  const Case c = makeCase();
  const Plane<float>&a = c.pt().mean[1], &b = c.crn().mean[1];
  Plane<float> noise = c.pt().variance[1];
  for (int x = 0; x < noise.width; ++x) noise.at(x, 11) *= 20;
  noise.at(3, 2) = 0;
  for (const LevelOf of : {LevelOf::Window, LevelOf::AlikeInNoise}) {
    const Plane<double> unit = residualScale(a, b, noise, of);
    for (const auto& [px, py] : {std::pair{20, 12}, {20, 11}, {0, 0}, {3, 2}, {a.width - 1, a.height - 1}}) {
      double sum = 0, count = 0;
      for (int v = py - 3; v <= py + 3; ++v)
        for (int u = px - 3; u <= px + 3; ++u) {
          const int x = mirrorIndex(u, a.width), y = mirrorIndex(v, a.height);
          const float own = noise.at(px, py), other = noise.at(x, y);
          if (of == LevelOf::AlikeInNoise && std::max(own, other) > 8 * std::min(own, other)) continue;
          sum += 0.5 * (std::sqrt(std::max(0.0, static_cast<double>(a.at(x, y)))) +
                        std::sqrt(std::max(0.0, static_cast<double>(b.at(x, y)))));
          ++count;
        }
      const double level = sqr(sum / count), epsilon = 1e-6 * planeMean(noise);
      CHECK(unit.at(px, py) ==
            doctest::Approx(std::sqrt((static_cast<double>(noise.at(px, py)) + epsilon) * (level * level + 0.01)))
                .epsilon(1e-5));
    }
  }
}

// The combination mends a lamp that half A has met more often than half B, and puts noise into the dark around it.
TEST_CASE("What a lamp gains does not speak for the dark beside it") {
  CaseOptions o;
  o.width = o.height = 64;
  o.constant = 0.1;
  Case c = makeCase(o);
  Estimate& y = c.estimates.estimates[0];
  Rgb<float> noise = y.variance, combined[2] = {c.truth, c.truth};
  for (size_t k = 0; k < 3; ++k) {
    for (int v = 30; v < 34; ++v)
      for (int u = 30; u < 34; ++u) {
        y.mean[k].at(u, v) = 100;
        y.half[0][k].at(u, v) = 150;
        y.half[1][k].at(u, v) = 50;
        noise[k].at(u, v) = 2500;
        combined[0][k].at(u, v) = combined[1][k].at(u, v) = 100;
      }
    for (int v = 26; v < 38; ++v)
      for (int u = 26; u < 38; ++u)
        if (y.mean[k].at(u, v) < 50) {
          combined[0][k].at(u, v) += 0.15f;
          combined[1][k].at(u, v) -= 0.15f;
        }
  }
  const auto share = combinedShares({y, y}, combined, noise);
  for (size_t k = 0; k < 3; ++k) CHECK(share[k].at(28, 28) < 0.2f);
}

// Chance gives a pixel's strong sample to the one image as often as to the other. What is kept of both samples together
// is one of them, in so far as the share is the same with either; the less noisy the correlated image is, the less the
// plain mean has of the other one, and the less its sample raises the share.
TEST_CASE("A rare strong sample is shared out and not lost, on average over the image that has met it") {
  constexpr float kExcess = 400;
  for (const double correlatedNoise : {1.0, 2.0}) {
    CaseOptions o;
    o.width = o.height = 64;
    o.constant = 1;
    o.correlatedNoise = correlatedNoise;
    const Added ofY = addedBy(o, 0, kExcess), ofZ = addedBy(o, 1, kExcess);
    for (const Added& a : {ofY, ofZ}) {
      CHECK(a.peak < 0.1 * static_cast<double>(kExcess));
      // Where both images are as noisy, single runs leave up to 0.2.
      if (correlatedNoise == 1) CHECK(a.highestPeak < 0.1 * static_cast<double>(kExcess));
    }
    const double kept = (ofY.light + ofZ.light) / static_cast<double>(kExcess);
    MESSAGE("noise of the correlated image ", correlatedNoise, ": kept ", kept);
    CHECK(kept > 0.9);
    CHECK(kept < 1.1);
  }
}

}  // namespace braid::test_uncorrelated_share
