// SPDX-License-Identifier: Apache-2.0
// The second pass over a combined image: what it smooths, what it keeps, and what auto gains by it.
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include "combiners/pipeline/pipeline.h"
#include "combiners/auto/refilter.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_refilter {

using namespace test;

namespace {

Case sized(uint64_t samples, double noise = 2, uint64_t seed = 1) {
  CaseOptions o;
  o.width = 128;
  o.height = 96;
  o.samples = samples;
  o.noise = noise;
  o.seed = seed;
  return makeCase(o);
}

// The truth with the noise that a box over 3x3 pixels leaves of that of the samples.
Estimate blotchy(const Case& c) {
  CaseOptions o = c.options;
  o.constant = 1;
  const Case grey = makeCase(o);
  Estimate out = grey.find("narrow");
  for (Rgb<float>* part : {&out.mean, &out.half[0], &out.half[1]})
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < c.truth.size(); ++i) (*part)[k][i] *= c.truth[k][i];
  return out;
}

Estimate again(const Case& c, const Estimate& image, bool features = true) {
  return refilter(image, features ? &*c.estimates.features : nullptr, c.options.samples);
}

double autoError(const Case& c, double refilters) {
  Estimates e = c.estimates;
  std::erase_if(e.estimates, [](const Estimate& x) { return x.name != "pt"; });
  PipelineOptions options;
  options.numbers.set("auto-refilter", refilters);
  return meanSquaredError(runPipeline(e, {"auto"}, options).find("auto")->result.image.mean, c.truth);
}

}  // namespace

TEST_CASE("The second pass takes most of the blotches and leaves the edges, with features or without") {
  for (const uint64_t samples : {16, 64, 256}) {
    const Case c = sized(samples);
    const Estimate image = blotchy(c);
    const double before = meanSquaredError(image.mean, c.truth), half = meanSquaredError(image.half[0], c.truth);
    CAPTURE(samples);
    for (const bool features : {false, true}) {
      const Estimate after = again(c, image, features);
      CAPTURE(features);
      CAPTURE(meanSquaredError(after.mean, c.truth) / before);
      CHECK(meanSquaredError(after.mean, c.truth) < 0.5 * before);
      for (const Rgb<float>& h : after.half) CHECK(meanSquaredError(h, c.truth) < 0.6 * half);
    }
  }
}

TEST_CASE("The second pass returns an image without noise") {
  const Case c = sized(16, 0);
  Estimate clean;
  clean.mean = clean.half[0] = clean.half[1] = c.truth;
  for (const bool features : {false, true})
    CHECK(std::sqrt(meanSquaredError(again(c, clean, features).mean, c.truth)) < 1e-3);
}

TEST_CASE("The second pass filters mean and halves with the same weights") {
  const Case c = sized(64);
  const Estimate after = again(c, c.find("narrow"));
  double worst = 0;
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < after.mean.size(); ++i) {
      const double mean = static_cast<double>(after.mean[k][i]);
      const double halves = 0.5 * (static_cast<double>(after.half[0][k][i]) + static_cast<double>(after.half[1][k][i]));
      worst = std::max(worst, std::fabs(mean - halves) / (std::fabs(mean) + 1e-3));
    }
  CHECK(worst < 1e-5);
}

TEST_CASE("The second pass keeps a firefly of one half where it is") {
  const Case c = sized(64);
  Estimate image = c.find("narrow");
  const size_t at = 48 * 128 + 64;
  for (size_t k = 0; k < 3; ++k) {
    image.half[0][k][at] += 2000;
    image.mean[k][at] += 1000;
  }
  const Estimate usual = again(c, c.find("narrow")), withFirefly = again(c, image);
  for (int dy = -6; dy <= 6; ++dy)
    for (int dx = -6; dx <= 6; ++dx) {
      if (std::abs(dx) <= 1 && std::abs(dy) <= 1) continue;  // whose variance is smoothed with that of the firefly
      const size_t i = at + static_cast<size_t>(dy * 128 + dx);
      CHECK(std::fabs(withFirefly.mean[1][i] - usual.mean[1][i]) < 0.1f);
    }
}

TEST_CASE("The second pass of images of one pixel, and of infinite features, is finite") {
  for (const auto& [width, height] : {std::pair(1, 1), {7, 3}, {1, 40}}) {
    CaseOptions o;
    o.width = width;
    o.height = height;
    Case c = makeCase(o);
    for (float& v : c.estimates.features->albedo.mean[0].data) v = std::numeric_limits<float>::infinity();
    for (float& v : c.estimates.features->depth.variance.data) v = std::numeric_limits<float>::quiet_NaN();
    for (const Plane<float>& p : again(c, c.pt()).mean.channel)
      for (const float v : p.data) CHECK(std::isfinite(v));
  }
}

TEST_CASE("auto has less error with its second pass, over cases and samples" * doctest::test_suite("statistics")) {
  double logarithms = 0;
  int cases = 0;
  for (const uint64_t samples : {8, 32, 128})
    for (const uint64_t seed : {1, 2}) {
      const Case c = sized(samples, 2, seed);
      const double with = autoError(c, 1), without = autoError(c, 0);
      CAPTURE(samples);
      CAPTURE(with / without);
      CHECK(with < 1.02 * without);
      logarithms += std::log(with / without);
      ++cases;
    }
  CAPTURE(std::exp(logarithms / cases));
  CHECK(std::exp(logarithms / cases) < 0.9);
}

}  // namespace braid::test_refilter
