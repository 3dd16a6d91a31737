// SPDX-License-Identifier: Apache-2.0
// Halves that a denoiser has filtered with the weights of all samples carry each other's noise; js has each denoised by
// itself.
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include "combiners/statistics/half_estimate.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/noisy_images.h"

namespace braid::test_own_halves {

using namespace test;

namespace {

// Leaves: every pixel differs from its neighbours, and no feature tells how. Quarters have normal noise of the
// deviation 2 x 0.2, so that the mean's is 0.2.
struct Leaves {
  Estimates all;
  Rgb<float> truth{kWidth, kHeight};
  const Estimate& pt() const { return all.estimates[0]; }
};

Leaves leaves(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 0.4);
  std::uniform_real_distribution<double> uniform(0.4, 1.6);
  Leaves l;
  l.all.width = l.all.fullWidth = kWidth;
  l.all.height = l.all.fullHeight = kHeight;
  Estimate e;
  e.name = "pt";
  e.passes = 64;
  e.mean = e.half[0] = e.half[1] = Rgb<float>(kWidth, kHeight);
  e.quarter.assign(4, e.mean);
  e.variance = Rgb<float>(kWidth, kHeight, 0.04f);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < e.mean.size(); ++i) {
      l.truth[c][i] = static_cast<float>(uniform(random));
      for (Rgb<float>& q : e.quarter) q[c][i] = l.truth[c][i] + static_cast<float>(normal(random));
      for (size_t h = 0; h < 2; ++h) e.half[h][c][i] = 0.5f * (e.quarter[h][c][i] + e.quarter[h + 2][c][i]);
      e.mean[c][i] = 0.5f * (e.half[0][c][i] + e.half[1][c][i]);
    }
  l.all.estimates.push_back(std::move(e));
  return l;
}

// The slope of a denoised half by the noise of the other half of the samples.
double slopeByOther(const Rgb<float>& denoised, const Rgb<float>& other, const Rgb<float>& truth) {
  double sum = 0, noise = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < truth.size(); ++i) {
      const double n = static_cast<double>(other[c][i]) - static_cast<double>(truth[c][i]);
      sum += n * (static_cast<double>(denoised[c][i]) - static_cast<double>(truth[c][i]));
      noise += n * n;
    }
  return sum / noise;
}

}  // namespace

TEST_CASE("Half of an estimate has the half's mean and passes, twice its variance, and quarters for halves") {
  const Leaves l = leaves(1);
  const GivenQuarters quarters{&l.pt().quarter, 2};
  CHECK(hasHalfEstimates(l.pt(), quarters));
  for (int h = 0; h < 2; ++h) {
    const Estimate half = halfEstimate(l.pt(), quarters, h);
    CHECK(half.passes == 32);
    double variance = 0;
    for (size_t i = 0; i < half.mean.size(); ++i) {
      CHECK(half.mean[1][i] == l.pt().half[h][1][i]);
      for (size_t k = 0; k < 2; ++k)
        CHECK(half.half[k][1][i] == 2 * l.pt().quarter[static_cast<size_t>(h) + 2 * k][1][i]);
      variance += static_cast<double>(half.variance[1][i]) / static_cast<double>(half.mean.size());
    }
    CHECK(variance == doctest::Approx(0.08).epsilon(0.02));
  }
  Estimate odd = l.pt();
  odd.passes = 5;
  CHECK(halfEstimate(odd, quarters, 0).passes + halfEstimate(odd, quarters, 1).passes == 5);
  odd.passes = 3;
  CHECK_FALSE(hasHalfEstimates(odd, quarters));
  CHECK_FALSE(hasHalfEstimates(l.pt(), {}));
}

TEST_CASE("Values of quarters that are not finite are not handed on") {
  Leaves l = leaves(1);
  l.all.estimates[0].quarter[0][0][7] = std::numeric_limits<float>::quiet_NaN();
  l.all.estimates[0].quarter[2][0][7] = std::numeric_limits<float>::infinity();
  const Estimate half = halfEstimate(l.pt(), {&l.pt().quarter, 1}, 0);
  CHECK(half.half[0][0][7] == 0);
  CHECK(std::isfinite(half.half[1][0][7]));
}

// Without a dependence the slope has the standard deviation 0.35 / (0.28 sqrt(3 x 10800)) = 0.007, of the denoised over
// that of the noise: the second bound is four of it, a false alarm of 6e-5.
TEST_CASE("A half of RDFC carries noise of the other half; denoised by itself it does not") {
  const Leaves l = leaves(2);
  MethodInputs in;
  in.unbiased = &l.pt();
  const auto method = make_rdfc();
  CHECK(method->halvesShareWeights());
  const MethodResult shared = method->run(in);
  for (int h = 0; h < 2; ++h) {
    const Estimate half = halfEstimate(l.pt(), {&l.pt().quarter, 1}, h);
    in.unbiased = &half;
    const double before = slopeByOther(shared.image.half[h], l.pt().half[1 - h], l.truth);
    const double after = slopeByOther(method->run(in).image.mean, l.pt().half[1 - h], l.truth);
    CAPTURE(before);
    CAPTURE(after);
    CHECK(before > 0.05);
    CHECK(std::fabs(after) < 0.028);
  }
}

TEST_CASE("js towards RDFC is better than the unbiased image where neighbours differ, as halves are denoised apart" *
          doctest::test_suite("statistics")) {
  const Leaves l = leaves(3);
  const auto errorWith = [&](double own) {
    PipelineOptions options;
    options.numbers.set("js-own-halves", own);
    return meanSquaredError(runPipeline(l.all, {"js@rdfc"}, options).find("js@rdfc")->result.image.mean, l.truth);
  };
  const double noise = meanSquaredError(l.pt().mean, l.truth), apart = errorWith(1), shared = errorWith(0);
  CAPTURE(apart / noise);
  CAPTURE(shared / noise);
  CHECK(apart < noise);
  CHECK(apart < 0.95 * shared);
}

TEST_CASE("Denoisers whose halves share weights ask for the quarters that tell them apart") {
  int sharing = 0;
  for (const auto& m : makeMethods())
    if (m->halvesShareWeights()) {
      CHECK(m->needs().helpful.quarters);
      ++sharing;
    }
  CHECK(sharing == 1);
}

}  // namespace braid::test_own_halves
