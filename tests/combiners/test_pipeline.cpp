// SPDX-License-Identifier: Apache-2.0
// The pipeline of denoisers and combiners: exposure, roles, order, chains, and the sentences of what cannot run.
#include <doctest/doctest.h>

#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/contains.h"

namespace braid::test_pipeline {

using namespace test;

namespace {

// pt and crn with everything, and sppm.
AvailableEstimates everythingAvailable() {
  AvailableEstimates f;
  f.features = f.reference = true;
  f.estimates = {{"pt", true, Correlation::Independent, 64, true, true, true, 7},
                 {"crn", true, Correlation::CommonRandomNumbers, 64, true, true, true, 7},
                 {"sppm", false, Correlation::Independent, 64, true, true, true, 7, {}, true}};
  return f;
}

CombinePlanOptions boxes() {
  CombinePlanOptions o;
  o.denoisers = {"box"};
  o.bases = {"box", "sppm"};
  return o;
}

std::string skipReasonOf(const AvailableEstimates& available, const std::string& name,
                         const CombinePlanOptions& options = boxes()) {
  const CombinePlan combinePlan = makeCombinePlan(available, {name}, options);
  REQUIRE(combinePlan.find(name));
  return combinePlan.find(name)->skipReason;
}

std::vector<std::string> namesOf(const CombinePlan& combinePlan) {
  std::vector<std::string> names;
  for (const Step& s : combinePlan.steps) names.push_back(s.name);
  return names;
}

std::string usageError(const AvailableEstimates& available, const std::string& name) {
  try {
    makeCombinePlan(available, {name}, {});
  } catch (const Error& e) {
    CHECK(e.code() == ExitCode::Usage);
    return e.what();
  }
  return {};
}

CaseOptions sized(int width, int height, uint64_t samples = 16) {
  CaseOptions o;
  o.width = width;
  o.height = height;
  o.samples = samples;
  return o;
}

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

TEST_CASE("Estimates fill their roles, and names override the rules") {
  AvailableEstimates available = everythingAvailable();
  available.estimates.push_back({"bdpt", true, Correlation::Independent, 64, true, true, true, 7});
  const auto step = [&](const std::string& name, CombinePlanOptions o) {
    const CombinePlan combinePlan = makeCombinePlan(available, {name}, o);
    REQUIRE(combinePlan.find(name));
    return *combinePlan.find(name);
  };
  CombinePlanOptions none;
  CHECK(step("inverse-variance", none).unbiased == "pt");
  CHECK(step("inverse-variance", none).biased == "sppm");
  CHECK(step("inverse-variance", boxes()).biased == "box");
  CHECK(step("inverse-variance@sppm", boxes()).biased == "sppm");
  CombinePlanOptions named;
  named.unbiased = "bdpt";
  named.biased = "box";
  CHECK(step("inverse-variance", named).unbiased == "bdpt");
  CHECK(step("inverse-variance", named).biased == "box");
  named.unbiased = "vcm";
  CHECK(contains(step("inverse-variance", named).skipReason, "vcm, which does not exist"));
  CHECK(step("average", boxes()).bases == std::vector<std::string>{"box", "sppm"});
  // An estimate that is consistent only takes the place where nothing is unbiased, and is no input beside itself.
  const AvailableEstimates before = available;
  available.estimates.push_back({"vcm", false, Correlation::Independent, 64, true, true, true, 7});
  CHECK(step("auto", none).unbiased == "pt");
  CHECK(step("auto", none).bases == std::vector<std::string>{"sppm", "vcm"});
  std::erase_if(available.estimates, [](const AvailableEstimate& e) { return e.unbiased; });
  CHECK(step("auto", none).unbiased == "vcm");
  CHECK(step("auto", none).bases == std::vector<std::string>{"sppm"});
  CHECK(step("js", none).biased == "sppm");
  // Photon maps and images of denoisers never do.
  available.estimates.back() = {"nfor", false, Correlation::Independent, 64, true, true, true, 7};
  CHECK(contains(step("auto", none).skipReason, "needs an unbiased estimate"));
  available.estimates.back().name = "other";
  available.estimates.back().variance = false;
  CHECK(contains(step("auto", none).skipReason, "needs an unbiased estimate"));
  available = before;
  // Whatever is registered: box is for stress tests and stands nowhere by itself.
  for (const auto& m : makeMethods()) {
    const Step s = step(m->name(), none);
    CHECK(s.biased != "box");
    CHECK(std::count(s.bases.begin(), s.bases.end(), "box") == 0);
  }
}

TEST_CASE("Inputs come before the methods that read them, each once") {
  const AvailableEstimates available = everythingAvailable();
  using Names = std::vector<std::string>;
  CHECK(namesOf(makeCombinePlan(available, {"average", "inverse-variance@box", "easy@box", "average"}, boxes())) ==
        Names{"box", "average", "inverse-variance@box", "easy@box"});
  CHECK(namesOf(makeCombinePlan(available, {"inverse-variance@easy@box"}, {})) ==
        Names{"box", "easy@box", "inverse-variance@easy@box"});
  CombinePlanOptions chained = boxes();
  chained.biased = "easy";
  CHECK(namesOf(makeCombinePlan(available, {"inverse-variance"}, chained)) == Names{"box", "easy", "inverse-variance"});
  // The named input gets the default one itself, and no method becomes its own input.
  chained.biased = "inverse-variance";
  const CombinePlan self = makeCombinePlan(available, {"inverse-variance"}, chained);
  CHECK(self.find("inverse-variance")->biased == "box");
  CombinePlanOptions loop;
  loop.bases = {"average", "sppm"};
  CHECK(contains(skipReasonOf(available, "average", loop), "its own input"));
}

TEST_CASE("A method goes before an estimate of its name") {
  Case c = makeCase(sized(16, 12));
  Estimate stale = c.find("wide");
  stale.name = "box";
  c.estimates.estimates.push_back(stale);
  const PipelineResult r = runPipeline(c.estimates, {"inverse-variance@box", "box"}, {});
  REQUIRE(r.find("box"));
  CHECK(std::sqrt(meanSquaredError(r.find("box")->result.image.mean, detail::boxFilter(c.pt().mean, 7))) < 1e-6);
}

TEST_CASE("What cannot run names what is missing, for every registered method") {
  for (const auto& m : makeMethods()) {
    const std::string name = m->name();
    const auto* outside = dynamic_cast<const ExternalMethod*>(m.get());
    if (outside && !outside->skipReason().empty()) {
      CHECK(skipReasonOf(everythingAvailable(), name) == outside->skipReason());
      continue;
    }
    CAPTURE(name);
    CHECK(skipReasonOf(everythingAvailable(), name) == "");
    const Needs needs = m->needs();
    const auto without = [&](auto change) {
      AvailableEstimates available = everythingAvailable();
      change(available);
      return skipReasonOf(available, name);
    };
    const auto expect = [&](bool needed, const std::string& skipReason, const char* word) {
      if (needed)
        CHECK_MESSAGE(contains(skipReason, word), skipReason);
      else
        CHECK(skipReason == "");
    };
    expect(true, without([](AvailableEstimates& f) { f.estimates.erase(f.estimates.begin()); }), "unbiased estimate");
    expect(needs.halves, without([](AvailableEstimates& f) { f.estimates[0].halves = false; }), "halves of pt");
    expect(needs.variance, without([](AvailableEstimates& f) { f.estimates[0].variance = false; }), "variance of pt");
    expect(needs.quarters, without([](AvailableEstimates& f) { f.estimates[0].quarters = false; }),
           "quarter buffers of pt");
    expect(needs.correlated, without([](AvailableEstimates& f) { f.estimates.erase(f.estimates.begin() + 1); }),
           "correlated");
    expect(needs.reference, without([](AvailableEstimates& f) { f.reference = false; }), "needs a reference");
    if (needs.checkpoints > 0)
      expect(true, without([](AvailableEstimates& f) { f.estimates[0].checkpoints = 0; }), "checkpoint");
    if (needs.passes > 1)
      expect(true, without([&](AvailableEstimates& f) { f.estimates[0].passes = needs.passes - 1; }), "passes of pt");
    // Without passes being known, as from files, the halves have the word.
    expect(false, without([](AvailableEstimates& f) { f.estimates[0].passes = 0; }), "");
  }
  AvailableEstimates available = everythingAvailable();
  available.estimates[2].halves = false;
  CHECK(contains(skipReasonOf(available, "inverse-variance@sppm"), "halves of sppm"));
  CHECK(contains(skipReasonOf(available, "easy@sppm"), "sppm is none"));
  CHECK(contains(skipReasonOf(available, "box@sppm"), "takes no biased input"));
  CombinePlanOptions few;
  few.bases = {"box"};
  CHECK(contains(skipReasonOf(available, "average", few), "needs 2 bases"));
  CHECK(contains(skipReasonOf(available, "inverse-variance@external:none.exr"), "none.exr: no such file"));
}

TEST_CASE("An unknown name is a usage error that lists the known ones") {
  for (const char* name : {"jss", "inverse-variance@jss", "easy@easy@jss"}) {
    const std::string text = usageError(everythingAvailable(), name);
    CHECK(contains(text, "'jss'"));
    for (const auto& m : makeMethods()) CHECK(contains(text, m->name()));
  }
  CHECK(contains(usageError(everythingAvailable(), "box:3"), "takes no parameter"));
  CHECK(contains(usageError(everythingAvailable(), "external:a.exr:b.exr"), "external:FILE:HALFA:HALFB"));
}

TEST_CASE("What must be kept during a render is the union of what the steps need") {
  CHECK_FALSE(buffersOf(makeCombinePlan(everythingAvailable(), {"box"}, {})).quarters);
  for (const auto& m : makeMethods()) {
    const CombinePlan combinePlan = makeCombinePlan(everythingAvailable(), {m->name()}, boxes());
    if (!combinePlan.find(m->name())->skipReason.empty()) continue;
    const KeptBuffers all = buffersOf(combinePlan);
    CHECK(all.quarters >= m->needs().quarters);
    CHECK(all.features >= m->needs().helpful.features);
    CHECK(all.history >= (m->needs().checkpoints > 0));
  }
}

TEST_CASE("Results are in the units of the estimates and are estimates themselves") {
  CaseOptions o = sized(40, 30);
  o.light = 1000;
  const Case c = makeCase(o);
  PipelineOptions options;
  const PipelineResult r = runPipeline(c.estimates, {"box", "inverse-variance@box"}, options);
  CHECK(r.exposure == doctest::Approx(exposureScale(c.pt().mean)));
  REQUIRE(r.find("box"));
  const Estimate& box = r.find("box")->result.image;
  CHECK(box.name == "box");
  CHECK_FALSE(box.unbiased);
  CHECK(box.passes == 16);
  const Rgb<float> expected = detail::boxFilter(c.pt().mean, 7);
  CHECK(std::sqrt(meanSquaredError(box.mean, expected)) < 1e-6 * meanOfImage(expected));
  CHECK(std::sqrt(meanSquaredError(box.half[1], detail::boxFilter(c.pt().half[1], 7))) < 1e-6 * meanOfImage(expected));
  // The error map too: it is of the size of the squared error, light squared.
  const PipelineOutput& blend = *r.find("inverse-variance@box");
  double error = 0;
  for (const float v : blend.result.error.data) error += static_cast<double>(v) / 1200;
  const double actual = meanSquaredError(blend.result.image.mean, c.truth);
  CHECK(error > 0.3 * actual);
  CHECK(error < 3 * actual);
  // A series of checkpoints keeps its exposure.
  options.exposure = 0.5;
  CHECK(runPipeline(c.estimates, {"box"}, options).exposure == 0.5);
}

TEST_CASE("Seconds of inputs are counted once") {
  const Case c = makeCase(sized(64, 48));
  const PipelineResult r =
      runPipeline(c.estimates, {"average", "inverse-variance@easy@box"}, {boxes(), {}, 0, nullptr});
  const double box = r.find("box")->seconds, easy = r.find("easy@box")->seconds;
  CHECK(box > 0);
  CHECK(r.find("box")->inputSeconds == 0);
  CHECK(r.find("average")->inputSeconds == box);
  CHECK(r.find("easy@box")->inputSeconds == box);
  CHECK(r.find("inverse-variance@easy@box")->inputSeconds == doctest::Approx(box + easy));
}

TEST_CASE("Estimates whose planes differ in size are refused") {
  Case c = makeCase(sized(16, 12));
  c.estimates.estimates[0].half[0] = Rgb<float>(15, 12);
  CHECK_THROWS_AS(runPipeline(c.estimates, {"box"}, {}), Error);
}

TEST_CASE("Names of layers have no dots and no folders") {
  CHECK(layerName("js") == "js");
  CHECK(layerName("js@easy@nfor") == "js@easy@nfor");
  CHECK(layerName("external:/a/b/kpcn.out.exr:x.exr:y.exr") == "external-kpcn-out");
}

}  // namespace braid::test_pipeline
