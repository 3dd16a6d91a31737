// SPDX-License-Identifier: Apache-2.0
// The library's front door combines what it rendered.
#include <string>

#include <doctest/doctest.h>

#include "braid/braid.h"
#include "tests/support/contains.h"
#include "tests/support/render_fixture.h"

namespace braid::test_combine {

using test::contains;

namespace {

Settings small() {
  Settings settings = test::settingsFor(32, 18, 8);
  settings.keep.features = true;
  return settings;
}

}  // namespace

TEST_CASE("A render keeps what the method reads, and is combined as the pipeline combines it") {
  const Scene scene(cornellBox());
  RenderPlan prepared = plan(scene, small());
  CHECK_FALSE(prepared.plan.kept.quarters);
  keepFor("auto", prepared);
  CHECK(prepared.plan.kept.quarters);
  const Rendering r = render(scene, prepared);

  const Combination c = combine(*r.estimates);
  const PipelineResult expected = runPipeline(*r.estimates, {"auto"}, {});
  CHECK(c.planes.at("G").data == expected.find("auto")->result.image.mean[1].data);
  CHECK(c.planes.at("G").data != r.planes.at("G").data);
  CHECK(c.planes.at("Error.Y").size() == 32 * 18);
  CHECK(c.step.unbiased == "pt");
}

TEST_CASE("An image of the inputs alone, and chains of methods, are combined by their name") {
  const Scene scene(cornellBox());
  const Rendering r = render(scene, plan(scene, small()));
  CHECK(combine(*r.estimates, "js@nlm").step.name == "js@nlm");
  CHECK(combine(*r.estimates, "box").planes.count("R") == 1);
}

TEST_CASE("Unknown methods and methods without their inputs are errors that say why") {
  const Scene scene(cornellBox());
  const Rendering r = render(scene, plan(scene, small()));
  const auto refusal = [&](const std::string& method) {
    try {
      combine(*r.estimates, method);
    } catch (const Error& e) {
      return std::to_string(static_cast<int>(e.code())) + ": " + e.what();
    }
    return std::string("none");
  };
  CHECK(contains(refusal("nonsense"), "1: "));
  CHECK(contains(refusal("nonsense"), "nonsense"));
  CHECK(contains(refusal("uncorrelated"), "2: uncorrelated cannot run: "));
}

}  // namespace braid::test_combine
