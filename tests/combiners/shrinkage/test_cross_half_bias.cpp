// SPDX-License-Identifier: Apache-2.0
// The bias of a photon map that it does not know of, as an unbiased image measures it, and what combiners make of it.
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include "combiners/statistics/half_statistics.h"
#include "combiners/shrinkage/fused_estimate.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pixels/plane_mean.h"
#include "combiners/pipeline/registry.h"
#include "combiners/shrinkage/cross_half_bias.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/noisy_images.h"

namespace braid::test_cross_half_bias {

using namespace test;

namespace {

// Every third column, as narrow leaves, has lost 0.3 of its light.
double narrow(int x, int) { return x % 3 == 0 ? 0.7 : 1.0; }
constexpr double kNarrowBias = 0.3 * 0.3 / 3;  // squared, on the average

}  // namespace

TEST_CASE("The light that narrow things lose is measured by the halves of both images") {
  for (const double deviation : {0.02, 0.2, 0.5}) {
    const Plane<float> bias = crossHalfSquaredBias(noisy(one, deviation, 1), photonMap(narrow, 0.5 * deviation, 2));
    // Of 169 products of deviations sqrt(1.25) d, three channels each, the mean has this standard error; the image
    // holds 64 windows of them: 4 deviations, one false alarm in 16,000 seeds. What is not significant counts as 0.
    const double window = 1.25 * deviation * deviation / std::sqrt(3 * 169.0);
    CAPTURE(deviation);
    CHECK(planeMean(bias) == doctest::Approx(kNarrowBias).epsilon(0.05 + 4 * window / 8 / kNarrowBias));
  }
}

TEST_CASE("Where neither image is biased hardly anything is found, and never more than a little of the noise") {
  const double deviation = 0.3;
  const Plane<float> bias = crossHalfSquaredBias(noisy(one, deviation, 3), photonMap(one, deviation, 4));
  size_t found = 0;
  double largest = 0;
  for (const float b : bias.data) {
    found += b > 0;
    largest = std::max(largest, static_cast<double>(b));
  }
  // Two deviations are exceeded on one side by 2.3 % of independent windows; the image has 64 of them.
  CHECK(static_cast<double>(found) < 0.12 * static_cast<double>(bias.size()));
  CHECK(largest < 0.5 * deviation * deviation);
}

TEST_CASE("A photon map that is brighter tells of light that the unbiased image has not found") {
  const auto dark = [](int x, int) { return x % 3 == 0 ? 0.4 : 1.0; };
  const Plane<float> bias = crossHalfSquaredBias(noisy(dark, 0.01, 5), photonMap(one, 0.01, 6));
  for (const float b : bias.data) CHECK(b == 0);
}

TEST_CASE("Fireflies of either image are no bias, and hide none") {
  Estimate x = noisy(one, 0.05, 7), s = photonMap(one, 0.05, 8), leaves = photonMap(narrow, 0.05, 8);
  for (Estimate* e : {&x, &s, &leaves})
    for (size_t c = 0; c < 3; ++c) {
      const size_t i = x.mean[0].index(e == &x ? 30 : 90, 45);
      e->half[0][c][i] = 2001;
      e->mean[c][i] = 1001;
    }
  const Plane<float> none = crossHalfSquaredBias(x, s), bias = crossHalfSquaredBias(x, leaves);
  for (const int column : {30, 90})
    for (int dx = -6; dx <= 6; ++dx) {
      CHECK(none.at(column + dx, 45) < 0.05 * 0.05);
      CHECK(bias.at(column + dx, 45) > 0.7 * kNarrowBias);
    }
}

TEST_CASE("Equal images, missing halves and extreme values") {
  const Estimate x = noisy(one, 0.1, 9);
  for (const float b : crossHalfSquaredBias(x, x).data) CHECK(std::isfinite(b));
  Estimate same = noisy(one, 0, 9);
  for (const float b : crossHalfSquaredBias(same, same).data) CHECK(b == 0);
  Estimate none = x;
  none.half[1] = Rgb<float>();
  CHECK(crossHalfSquaredBias(x, none).empty());
  CHECK(crossHalfSquaredBias(none, x).empty());
  Estimate huge = x;
  for (Rgb<float>* image : {&huge.mean, &huge.half[0], &huge.half[1]})
    for (Plane<float>& plane : image->channel)
      for (float& v : plane.data) v *= 1e30f;
  for (const float b : crossHalfSquaredBias(huge, x).data) CHECK(std::isfinite(b));
}

TEST_CASE("A photon map that has lost light in narrow things, unknowingly, does not spoil the fused image") {
  for (const double deviation : {0.05, 0.2}) {
    const Estimate x = noisy(one, deviation, 10), s = photonMap(narrow, 0.1 * deviation, 11);
    const double fused = squaredError(fusedEstimate(x, {&s}, nullptr).image.mean, 1);
    const double best = std::min(squaredError(x.mean, 1), squaredError(s.mean, 1));
    CAPTURE(deviation);
    CHECK(fused < 1.02 * best);  // by its own word alone 24 times as much at 0.05
  }
}

TEST_CASE("double-shrinkage: what a photon map does not know of its bias, and its fireflies") {
  Estimate x = noisy(one, 0.05, 12), s = photonMap(narrow, 0.005, 13);
  const auto errorWith = [&](const char* option, double value) {
    MethodInputs in;
    in.unbiased = &x;
    in.biased = &s;
    in.options.set(std::string("double-shrinkage-") + option, value);
    return squaredError(make_double_shrinkage()->run(in).image.mean, 1);
  };
  CHECK(errorWith("measured", 1) < 1.1 * squaredError(x.mean, 1));
  CHECK(errorWith("measured", 0) > 3 * errorWith("measured", 1));
  // One photon in one quarter.
  s = photonMap(one, 0.02, 14);
  const size_t firefly = s.mean[0].index(60, 45);
  for (size_t c = 0; c < 3; ++c) {
    s.half[0][c][firefly] = 401;
    s.mean[c][firefly] = 201;
    s.variance[c][firefly] = 200 * 200;
  }
  CHECK(errorWith("remove-fireflies", 1) < squaredError(x.mean, 1));
  CHECK(errorWith("remove-fireflies", 0) > 2 * errorWith("removeFireflies", 1));
}

TEST_CASE("double-shrinkage of a photon map with fireflies does not depend on what else is asked for") {
  CaseOptions o;
  o.samples = 16;
  Case c = makeCase(o);
  Estimate& s = c.estimates.estimates[2];
  REQUIRE(s.quarter.size() == 4);
  // A firefly that one quarter holds, and one that two quarters of both halves hold: quarters alone tell of that.
  for (const auto& [x, quarters] : {std::pair(20, std::array{400.0f, 0.0f, 0.0f, 0.0f}), {40, {400.0f, 400.0f, 0, 0}}})
    for (size_t k = 0; k < 3; ++k) {
      for (size_t q = 0; q < 4; ++q) s.quarter[q][k].at(x, 20) += quarters[q];
      for (size_t h = 0; h < 2; ++h) s.half[h][k].at(x, 20) += 0.5f * (quarters[h] + quarters[h + 2]);
      s.mean[k].at(x, 20) = 0.5f * (s.half[0][k].at(x, 20) + s.half[1][k].at(x, 20));
      s.variance[k].at(x, 20) = 1e4f;
    }
  const auto image = [&](const std::vector<std::string>& wanted) {
    const PipelineResult r = runPipeline(c.estimates, wanted, {});
    REQUIRE(r.find("double-shrinkage@sppm"));
    return r.find("double-shrinkage@sppm")->result.image.mean;
  };
  const Rgb<float> alone = image({"double-shrinkage@sppm"});
  CHECK(identical(alone, image({"auto", "double-shrinkage@sppm"})));
  for (Estimate& e : c.estimates.estimates) e.quarter.clear();
  CHECK_FALSE(identical(alone, image({"double-shrinkage@sppm"})));
}

}  // namespace braid::test_cross_half_bias
