// SPDX-License-Identifier: Apache-2.0
// The pipeline of denoisers and combiners: roles, order, chains, and the sentences of what cannot run.
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

}  // namespace

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
    // A single pass is completed to what two show.
    expect(needs.passes > 2, without([](AvailableEstimates& f) { f.estimates[0].passes = 1; }), "passes of pt");
    if (needs.passes > 2)
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
