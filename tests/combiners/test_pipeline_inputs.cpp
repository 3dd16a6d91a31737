// SPDX-License-Identifier: Apache-2.0
// What methods are given: exposure, finite and limited values, features, and no copy of what nothing reads.
#include <doctest/doctest.h>

#include "combiners/pipeline/pipeline.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_pipeline_inputs {

using namespace test;

namespace {

Rgb<float> grey(int width, int height, float value) { return {width, height, value}; }

}  // namespace

TEST_CASE("The exposure scale brings any image to middle grey, whatever its units") {
  CHECK(exposureScale(grey(40, 30, 1)) == doctest::Approx(0.18));
  for (const float light : {1e-12f, 1e-6f, 1.0f, 1e6f, 1e12f})
    CHECK(exposureScale(grey(33, 50, light)) * static_cast<double>(light) == doctest::Approx(0.18).epsilon(1e-6));
  CHECK(exposureScale(grey(40, 30, 0)) == 1);
  CHECK(exposureScale({}) == 1);
  CHECK(exposureScale(grey(1, 1, 2)) == doctest::Approx(0.09));
  // Two tiles, one four times brighter: the mean of logarithms is their geometric mean. One black: it does not count.
  Rgb<float> two = grey(32, 16, 1);
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 16; ++x) two[c].at(x, y) = 4;
  CHECK(exposureScale(two) == doctest::Approx(0.09));
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 16; ++x) two[c].at(x, y) = 1e-12f;
  CHECK(exposureScale(two) == doctest::Approx(0.18));
  // A pixel that is no number counts as black.
  Rgb<float> bad = grey(16, 16, 1);
  bad[0].at(3, 3) = std::nanf("");
  CHECK(exposureScale(bad) == doctest::Approx(0.18 * 256 / 255));
}

TEST_CASE("Bad values are set to zero and counted") {
  // In place; and the report.
  const auto sanitise = [](Estimates& e) {
    SanitiseReport report;
    e = normalised(e, 1, report);
    return report;
  };
  Estimates e = makeCase(sized(8, 6)).estimates;
  CHECK(sanitise(e).clean());
  e.estimates[0].mean[0][3] = kInfinity;
  e.estimates[0].half[1][2][5] = std::nanf("");
  e.estimates[1].quarter[2][1][7] = -kInfinity;
  e.estimates[0].variance[0][0] = -1;
  e.features->depth.mean[2] = kInfinity;
  e.features->normal.variance[1][2] = -2;
  e.history["pt"][1].variance[0][1] = std::nanf("");
  const SanitiseReport report = sanitise(e);
  CHECK(report.nonFinite == 5);
  CHECK(report.negativeVariance == 2);
  CHECK(report.outOfRange == 0);
  CHECK(e.estimates[0].mean[0][3] == 0);
  CHECK(e.estimates[0].variance[0][0] == 0);
  CHECK(sanitise(e).clean());
  // A negative colour is no error: perturbed images and regressions have them.
  e.estimates[0].mean[0][3] = -1;
  CHECK(sanitise(e).clean());
}

TEST_CASE("Scaling multiplies colours by k and variances by its square, and back") {
  const Estimates before = makeCase(sized(8, 6)).estimates;
  SanitiseReport report;
  const Estimates e = normalised(before, 4, report);
  CHECK(e.estimates[2].mean[1][9] == 4 * before.estimates[2].mean[1][9]);
  CHECK(e.estimates[2].quarter[3][1][9] == 4 * before.estimates[2].quarter[3][1][9]);
  CHECK(e.estimates[2].bias[1][9] == 4 * before.estimates[2].bias[1][9]);
  CHECK(e.estimates[2].biasHalf[1][1][9] == 4 * before.estimates[2].biasHalf[1][1][9]);
  CHECK(e.estimates[2].variance[1][9] == 16 * before.estimates[2].variance[1][9]);
  CHECK(e.estimates[2].biasVariance[1][9] == 16 * before.estimates[2].biasVariance[1][9]);
  CHECK(e.history.at("pt")[2].variance[1][9] == 16 * before.history.at("pt")[2].variance[1][9]);
  CHECK(identical(e.features->albedo.variance, before.features->albedo.variance));
  CHECK(report.clean());
  for (size_t i = 0; i < 3; ++i) {
    MethodResult r;
    r.image = e.estimates[i];
    r.error = e.estimates[i].variance[0];
    undoExposure(r, 4);
    CHECK(identical(r.image.mean, before.estimates[i].mean));
    CHECK(identical(r.image.quarter[3], before.estimates[i].quarter[3]));
    CHECK(identical(r.image.variance, before.estimates[i].variance));
    CHECK(identical(r.error, before.estimates[i].variance[0]));
  }
}

TEST_CASE("Normalised values beyond the range of methods are moved to its end") {
  Estimates e = makeCase(sized(8, 6)).estimates;
  e.estimates[0].mean[0][3] = 1e9f;
  e.estimates[0].half[1][2][5] = -3e38f;
  e.estimates[0].variance[1][0] = 1e18f;
  e.features->depth.mean[2] = 1e10f;
  SanitiseReport report;
  const Estimates n = normalised(e, 2, report);
  CHECK(report.outOfRange == 4);
  CHECK(n.estimates[0].mean[0][3] == 1e9f);
  CHECK(n.estimates[0].half[1][2][5] == -1e9f);
  CHECK(n.estimates[0].variance[1][0] == doctest::Approx(1e18f));
  CHECK(n.features->depth.mean[2] == 1e9f);
}

TEST_CASE("Features are read as they are unless something in them must be changed") {
  const Features good = *makeCase(sized(8, 6)).estimates.features;
  CHECK(isSane(good, false));
  CHECK(isSane(good, true));
  const auto bad = [&](auto change) {
    Features f = good;
    change(f);
    return f;
  };
  for (const float value : {std::nanf(""), HUGE_VALF, 2e9f, -2e9f})
    CHECK_FALSE(isSane(bad([&](Features& f) { f.normal.mean[1][5] = value; }), false));
  const Features badHalf = bad([](Features& f) { f.depth.half[1][3] = std::nanf(""); });
  CHECK(isSane(badHalf, false));
  CHECK_FALSE(isSane(badHalf, true));
  CHECK_FALSE(isSane(bad([](Features& f) { f.albedo.variance[0][7] = -1; }), true));
}

TEST_CASE("What no method reads is not copied") {
  const Estimates all = makeCase(sized(8, 6)).estimates;
  SanitiseReport report;
  const Estimates few = normalised(all, 1, report, {{.features = true}});
  CHECK(few.estimates[0].quarter.empty());
  CHECK(few.history.empty());
  CHECK(identical(few.features->normal.mean, all.features->normal.mean));
  CHECK(few.features->normal.half[0].empty());
  CHECK(few.features->depth.variance.empty());
  CHECK_FALSE(normalised(all, 1, report, {{.featureNoise = true, .quarters = true, .history = true}}).features);
  const auto read = [&](const char* method) {
    return planesRead(makeCombinePlan(availableIn(all), {method}, {})).buffers;
  };
  CHECK(read("nfor").featureNoise);
  CHECK_FALSE(read("nfor").quarters);
  CHECK(read("auto").featureNoise);
  CHECK(read("pw").features);
  CHECK_FALSE(read("pw").featureNoise);
  CHECK_FALSE(read("auto").history);
  CHECK(read("curves@nlm").history);
  CHECK_FALSE(read("box").features);
  CHECK(read("uncorrelated").quarters);
  CHECK(read("auto").quarters);  // fused with those of the photon map
  Estimates alone = all;
  alone.estimates.resize(1);
  CHECK_FALSE(planesRead(makeCombinePlan(availableIn(alone), {"auto"}, {})).buffers.quarters);
  CHECK_FALSE(planesRead(makeCombinePlan(availableIn(alone), {"auto"}, {})).buffers.directIndirect);
  Estimate& e = alone.estimates[0];
  e.direct = {e.mean, {e.half[0], e.half[1]}, e.variance};
  e.indirectVariance = e.variance;
  CHECK(planesRead(makeCombinePlan(availableIn(alone), {"auto"}, {})).buffers.directIndirect);
  CHECK_FALSE(planesRead(makeCombinePlan(availableIn(alone), {"js@pw"}, {})).buffers.directIndirect);
  CHECK(normalised(alone, 1, report, {{.features = true, .featureNoise = true, .quarters = true, .history = true}})
            .estimates[0]
            .direct.mean.empty());
  const Estimate doubled = normalised(alone, 2, report).estimates[0];
  CHECK(doubled.direct.half[1][0][5] == 2 * e.half[1][0][5]);
  CHECK(doubled.indirectVariance[2][7] == 4 * e.variance[2][7]);
}

}  // namespace braid::test_pipeline_inputs
