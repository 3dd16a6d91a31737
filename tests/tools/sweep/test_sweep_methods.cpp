// SPDX-License-Identifier: Apache-2.0
// Methods of `braid sweep`: what they are named by, and which share a render.
#include <doctest/doctest.h>

#include "renderer/core/error.h"
#include "tests/combiners/auto_cases.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"
#include "tools/sweep/sweep.h"
#include "tools/sweep/methods/sweep_pipeline.h"
#include "tools/sweep/sweep_run.h"
#include "tools/sweep/table/sweep_table.h"
#include "tests/tools/sweep/small_sweeps.h"

namespace braid::test_sweep_methods {

using namespace test::small_sweeps;
using test::Folder;

TEST_CASE("Methods share a render where they share an integrator, and only there") {
  SweepMethod pt, bdpt, sppm, both, denoised, unequal;
  pt.inputs = {{"pt", 1}};
  bdpt.inputs = {{"bdpt", 1}};
  sppm.inputs = {{"sppm", 1}};
  both.inputs = {{"pt", 1}, {"sppm", 1}};
  denoised.inputs = {{"bdpt", 1}};
  unequal.inputs = {{"pt", 2}, {"sppm", 1}};
  const std::vector<SweepMethod> methods{pt, bdpt, sppm, both, denoised, unequal};
  using Groups = std::vector<std::vector<size_t>>;
  CHECK(groupMethods(methods, false) == Groups{{0, 2, 3}, {1, 4}, {5}});
  CHECK(groupMethods(methods, true) == Groups{{0}, {1, 4}, {2}, {3}, {5}});
}

TEST_CASE("Methods read the features of their own first integrator, whatever else is measured") {
  SweepMethod pt, bdpt, sppm, filter, mixed, other, vcm;
  pt.inputs = filter.inputs = {{"pt", 1}};
  bdpt.inputs = {{"bdpt", 1}};
  sppm.inputs = {{"sppm", 1}};
  mixed.inputs = {{"pt", 1}, {"sppm", 1}};
  other.inputs = {{"bdpt", 1}, {"sppm", 1}};
  vcm.inputs = {{"vcm", 1}};
  filter.buffers.features = mixed.buffers.features = other.buffers.features = true;
  using Groups = std::vector<std::vector<size_t>>;
  CHECK(groupMethods({sppm, bdpt, pt, filter, mixed, other, vcm}, false) == Groups{{0, 2, 3, 4}, {1, 5}, {6}});
  // One that joins two of them without features makes no one of them.
  SweepMethod both;
  both.inputs = {{"pt", 1}, {"bdpt", 1}};
  CHECK(groupMethods({pt, bdpt, both, filter, other}, false) == Groups{{0, 1, 2, 3}, {4}});
  // Of the methods of a job, one that reads features is asked first.
  SweepJob job;
  job.cells = {{&sppm, 8}, {&mixed, 8}};
  CHECK(job.inputs() == mixed.inputs);
}

TEST_CASE("The unbiased image is that of the unbiased integrator, wherever the plan names the photon map") {
  using namespace test::auto_cases;
  const auto estimates = std::make_shared<Estimates>(kept(noisyCase(16), {"pt", "sppm"}));
  const auto imageBy = [&](const char* plan) {
    return sweepMethods({"auto/auto"}, test::integrators(), {}, plan).at(0).finish(estimates, {});
  };
  const MethodImage first = imageBy("pt+sppm"), last = imageBy("sppm+pt");
  REQUIRE(!first.image.empty());
  CHECK(first.error == last.error);
  for (size_t c = 0; c < 3; ++c) CHECK(first.image[c].data == last.image[c].data);
}

TEST_CASE("Names of methods are integrators, or denoisers and combiners with the integrators that they read") {
  const auto inputs = [](const std::string& name) {
    std::vector<std::string> list;
    const std::vector<SweepMethod> methods = sweepMethods({name}, test::integrators());
    for (const MethodShare& share : methods.at(0).inputs) list.push_back(share.integrator);
    return list;
  };
  using Names = std::vector<std::string>;
  CHECK(inputs("pt") == Names{"pt"});
  CHECK(inputs("box") == Names{"pt"});
  CHECK(inputs("bdpt+sppm/auto") == Names{"bdpt", "sppm"});
  // By default the plain image, and what a render makes of the scene when nothing is said.
  CHECK(SweepOptions().methods == Names{"pt", "auto/auto"});
  const std::vector<SweepMethod> planned = sweepMethods({"auto/auto"}, test::integrators(), {}, "pt+sppm");
  CHECK(planned.at(0).name == "auto/auto");
  CHECK(planned.at(0).inputs == std::vector<MethodShare>{{"pt", 1}, {"sppm", 1}});
  for (const Integrator* i : test::integrators()) {
    const std::string name = i->name();
    if (name == "pt") continue;
    CHECK(inputs(name) == Names{name});
    if (i->unbiased() && i->correlation() == Correlation::Independent) CHECK(inputs(name + "/box") == Names{name});
  }
  const auto [code, reason] = failureOf([] { sweepMethods({"pt", "nothing"}, test::integrators()); });
  CHECK(code == ExitCode::Usage);
  CHECK(reason.find("'nothing'") != std::string::npos);
  CHECK(reason.find("integrators are pt") != std::string::npos);
}

TEST_CASE("Denoisers and combiners are measured on the render that pt is measured on") {
  const Folder folder;
  SweepOptions o = smallSweep(folder);
  o.methods = {"pt", "box"};
  o.seeds = 1;
  o.spp = parseLadder("4,8", false);
  REQUIRE(sweep(o) == 0);
  const SweepTable t = readSweepTable(o.output + "/sweep.csv");
  REQUIRE(t.rows.size() == 4);
  for (size_t i = 0; i < 2; ++i) {
    const SweepRow &pt = t.rows[i], &box = t.rows[i + 2];
    REQUIRE(box.method == "box");
    CHECK(box.render == pt.render);
    CHECK(box.denoise > 0);
    CHECK(box.combine == 0);
    CHECK(box.spp == pt.spp);
    CHECK(box.values[0] != pt.values[0]);
  }
}

}  // namespace braid::test_sweep_methods
