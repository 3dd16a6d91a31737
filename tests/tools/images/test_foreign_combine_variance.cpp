// SPDX-License-Identifier: Apache-2.0
// The variance of one image of another renderer is estimated from neighbouring pixels, and halves are made of both.
#include <doctest/doctest.h>

#include "combiners/pipeline/spatial_variance.h"
#include "tests/tools/images/foreign_cases.h"

namespace braid::test_foreign_combine_variance {

using namespace test;
using namespace test::foreign_cases;

namespace {

double meanOfPlanes(const Rgb<float>& image) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c)
    for (const float v : image[c].data) sum += static_cast<double>(v);
  return sum / (3 * static_cast<double>(image.size()));
}

}  // namespace

TEST_CASE(
    "Spatial variance: within a factor of 1.5 of the true one, with features and without, through edges and texture") {
  for (const double noise : {0.25, 1.0, 2.0}) {
    CAPTURE(noise);
    const Case c = noisyCase(192, 144, noise);
    // Errors against the truth, averaged over the image: the variance that an oracle would tell.
    double truth = 0;
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < c.truth.size(); ++i)
        truth += sqr(static_cast<double>(c.pt().mean[k][i]) - static_cast<double>(c.truth[k][i])) /
                 (3 * static_cast<double>(c.truth.size()));
    const double guided = meanOfPlanes(spatialVariance(c.pt().mean, &*c.estimates.features)),
                 blind = meanOfPlanes(spatialVariance(c.pt().mean, nullptr));
    CAPTURE(guided / truth);
    CAPTURE(blind / truth);
    CHECK(guided > truth / 1.5);
    CHECK(guided < truth * 1.5);
    CHECK(blind > truth / 1.5);
    CHECK(blind < truth * 1.5);
  }
}

TEST_CASE("Spatial variance: normal noise is met to 10 %, slopes have none, a firefly keeps its own") {
  Estimate e;
  e.mean = Rgb<float>(256, 256, 1.0f);
  e.variance = Rgb<float>(256, 256, 0.04f);
  makeHalves(e, 7);  // half 0 is 1 plus noise of variance 0.04
  CHECK(meanOfPlanes(spatialVariance(e.half[0], nullptr)) == doctest::Approx(0.04).epsilon(0.1));

  Rgb<float> slope(40, 30);
  for (size_t k = 0; k < 3; ++k)
    for (int y = 0; y < 30; ++y)
      for (int x = 0; x < 40; ++x) slope[k].at(x, y) = static_cast<float>(x + 2 * y);
  CHECK(meanOfPlanes(spatialVariance(slope, nullptr)) < 1e-6);
  slope[0].at(20, 15) += 1000;
  const Rgb<float> v = spatialVariance(slope, nullptr);
  CHECK(v[0].at(20, 15) > 1e5f);
  CHECK(v[0].at(23, 17) < 1e4f);
  CHECK(meanOfPlanes(spatialVariance(Rgb<float>(1, 1, 3.0f), nullptr)) == 0);
  CHECK(meanOfPlanes(spatialVariance(Rgb<float>(2, 40, 3.0f), nullptr)) == 0);
}

TEST_CASE("Spatial variance: small lamps neither count as noise nor lend theirs to what is around") {
  // Noise of a third of the light, and lamps of 2 x 2 and 5 x 5 pixels, ten thousand times as bright.
  Estimate e;
  e.mean = Rgb<float>(80, 60, 0.1f);
  e.variance = Rgb<float>(80, 60, 0.001f);
  makeHalves(e, 3);
  Rgb<float> image = e.half[0];
  for (size_t k = 0; k < 3; ++k)
    for (const auto& [size, at] : {std::pair(2, 20), {5, 50}})
      for (int y = 30; y < 30 + size; ++y)
        for (int x = at; x < at + size; ++x) image[k].at(x, y) = 1000;
  const Rgb<float> v = spatialVariance(image, nullptr);
  for (const auto& [x, y] : {std::pair(19, 30), {22, 33}, {24, 31}, {49, 32}, {55, 35}, {58, 30}})
    CHECK_MESSAGE(v[1].at(x, y) < 0.01f, x, " ", y);
  for (const auto& [x, y] : {std::pair(20, 30), {21, 31}, {50, 30}, {52, 32}, {54, 34}})
    CHECK_MESSAGE(v[1].at(x, y) < 1e4f, x, " ", y);
}

TEST_CASE("Halves from one image: their mean is the image, their errors are independent and of twice its variance") {
  Case c = noisyCase(256, 192, 0.25);
  Estimate e = c.pt();
  for (size_t k = 0; k < 3; ++k)  // the true variance: that of one sample is (noise · truth)²
    for (size_t i = 0; i < c.truth.size(); ++i)
      e.variance[k][i] = static_cast<float>(sqr(0.25 * static_cast<double>(c.truth[k][i])) / 16);
  makeHalves(e);
  double a2 = 0, b2 = 0, ab = 0, v = 0;
  for (size_t i = 0; i < c.truth.size(); ++i) {
    const double t = static_cast<double>(c.truth[1][i]), a = static_cast<double>(e.half[0][1][i]) - t,
                 b = static_cast<double>(e.half[1][1][i]) - t;
    CHECK(0.5f * e.half[0][1][i] + 0.5f * e.half[1][1][i] == doctest::Approx(e.mean[1][i]).epsilon(1e-5));
    a2 += a * a;
    b2 += b * b;
    ab += a * b;
    v += static_cast<double>(e.variance[1][i]);
  }
  // 49,152 pixels: a share of 1.5 % is more than two standard errors, four for the correlation.
  CHECK(a2 == doctest::Approx(2 * v).epsilon(0.05));
  CHECK(b2 == doctest::Approx(2 * v).epsilon(0.05));
  CHECK(std::abs(ab) < 0.04 * std::sqrt(a2 * b2));
}

}  // namespace braid::test_foreign_combine_variance
