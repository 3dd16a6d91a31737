// SPDX-License-Identifier: Apache-2.0
// Methods that see a reference: what they make is best in hindsight, and without a reference nothing runs.
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "combiners/ensemble/relative_weights.h"
#include "renderer/core/error.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_oracles {

using namespace test;

namespace {

double distance(const Rgb<float>& image, const Case& c, size_t channel, size_t i) {
  return std::fabs(static_cast<double>(image[channel][i]) - static_cast<double>(c.truth[channel][i]));
}

template <class Check>
void everywhere(const Rgb<float>& image, const Check& check) {
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < image.size(); ++i) check(c, i);
}

// Sum over a patch of 7x7 pixels of the squared distances of w a + (1 - w) b from the truth, relative to its level.
double patchError(const Rgb<float>& a, const Rgb<float>& b, double w, const Case& c, size_t channel,
                  std::pair<int, int> at) {
  const auto [x, y] = at;
  const Plane<float> roots = relativeErrorRoots(c.truth, Rgb<float>(c.truth.width(), c.truth.height()));
  double sum = 0;
  for (int j = std::max(0, y - 3); j <= std::min(c.truth.height() - 1, y + 3); ++j)
    for (int i = std::max(0, x - 3); i <= std::min(c.truth.width() - 1, x + 3); ++i) {
      const auto value = [&](const Rgb<float>& image) { return static_cast<double>(image[channel].at(i, j)); };
      sum += sqr((w * value(a) + (1 - w) * value(b) - value(c.truth)) * static_cast<double>(roots.at(i, j)));
    }
  return sum;
}

}  // namespace

TEST_CASE("Ideal blending is nowhere worse than its inputs, and exact between them") {
  const Case c = caseOf(48, 36, 16);
  const MethodInputs in = inputsOf(c, "wide");
  const Rgb<float> image = findMethod("ideal")->run(in).image.mean;
  size_t between = 0;
  everywhere(image, [&](size_t channel, size_t i) {
    const float n = in.unbiased->mean[channel][i], d = in.biased->mean[channel][i], r = c.truth[channel][i];
    const double rounding = 1e-6 * static_cast<double>(std::fabs(n) + std::fabs(d) + r);
    const double inputs =
        std::min(distance(in.unbiased->mean, c, channel, i), distance(in.biased->mean, c, channel, i));
    CHECK(distance(image, c, channel, i) <= inputs + rounding);
    if (!((n < r && r < d) || (d < r && r < n))) return;
    ++between;
    CHECK(distance(image, c, channel, i) <= rounding);
  });
  CHECK(between > image.size() / 2);
}

TEST_CASE("The ensemble in hindsight: a pixel's own errors leave none of its bases better") {
  const Case c = caseOf(48, 36, 16);
  MethodInputs in = inputsOf(c);
  in.options.set("ensemble-oracle-patch", 1);
  in.options.set("ensemble-oracle-filter", 0);
  const Rgb<float> image = findMethod("ensemble-oracle")->run(in).image.mean;
  everywhere(image, [&](size_t channel, size_t i) {
    for (const Estimate* base : in.bases)
      CHECK(distance(image, c, channel, i) <= distance(base->mean, c, channel, i) + 1e-5);
  });
}

TEST_CASE("The ensemble in hindsight: its weights are the best of a grid for whole images and for halves") {
  const Case c = caseOf(40, 30, 16);
  MethodInputs in = inputsOf(c);
  in.bases = {&c.find("narrow"), &c.find("wide")};
  in.options.set("ensemble-oracle-filter", 0);
  for (const bool halves : {false, true}) {
    in.options.set("ensemble-oracle-halves", halves);
    const MethodResult result = findMethod("ensemble-oracle")->run(in);
    const Estimate &a = *in.bases[0], &b = *in.bases[1];
    const auto errorOf = [&](double w, size_t channel, int x, int y) {
      if (!halves) return patchError(a.mean, b.mean, w, c, channel, {x, y});
      return 0.5 * (patchError(a.half[0], b.half[0], w, c, channel, {x, y}) +
                    patchError(a.half[1], b.half[1], w, c, channel, {x, y}));
    };
    for (const auto& [x, y] : {std::pair(0, 0), {20, 15}, {39, 29}, {7, 22}})
      for (size_t channel = 0; channel < 3; ++channel) {
        const auto at = [&](const Rgb<float>& image) { return static_cast<double>(image[channel].at(x, y)); };
        REQUIRE(at(a.mean) != at(b.mean));
        const double weight = (at(result.image.mean) - at(b.mean)) / (at(a.mean) - at(b.mean));
        double best = errorOf(0, channel, x, y);
        for (int k = 1; k <= 100; ++k) best = std::min(best, errorOf(k / 100.0, channel, x, y));
        CHECK(errorOf(weight, channel, x, y) <= best * 1.001);
      }
  }
}

TEST_CASE("What is best in hindsight has less error than what is estimated to be") {
  Case c = caseOf(96, 72, 32);
  for (const Estimate& d : c.denoised) c.estimates.estimates.push_back(d);
  c.estimates.reference = c.truth;
  PipelineOptions options;
  options.roles.bases = {"narrow", "wide", "sppm"};
  const PipelineResult r =
      runPipeline(c.estimates, {"ensemble", "ensemble-oracle", "curves@box", "ideal@box"}, options);
  const auto error = [&](const char* name) {
    REQUIRE(r.find(name));
    REQUIRE(r.find(name)->step.skipReason == "");
    return meanSquaredError(r.find(name)->result.image.mean, c.truth);
  };
  CHECK(error("ensemble-oracle") < error("ensemble"));
  CHECK(error("ideal@box") < error("curves@box"));
}

TEST_CASE("Without a reference, or with one of another size, nothing is made of it") {
  Case c = caseOf(24, 20, 16);
  PipelineOptions options;
  const PipelineResult r = runPipeline(c.estimates, {"ideal@sppm", "ensemble-oracle"}, options);
  for (const PipelineOutput& out : r.outputs)
    if (out.step.method->needs().reference) CHECK(out.step.skipReason.find("--reference FILE") != std::string::npos);
  c.estimates.reference = Rgb<float>(20, 24);
  CHECK_THROWS_AS(runPipeline(c.estimates, {"ideal@sppm"}, options), Error);
}

}  // namespace braid::test_oracles
