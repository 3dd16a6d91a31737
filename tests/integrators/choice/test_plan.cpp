// SPDX-License-Identifier: Apache-2.0
// Which integrators `auto` keeps: measured, with a reason for every one that is left out.
#include <doctest/doctest.h>

#include "integrators/light_preparation.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/render_fixture.h"

namespace braid::test_plan {

using namespace test;

namespace {

std::vector<std::string> kept(const Scene& scene) {
  Settings settings = settingsFor(128, 72, 1);
  settings.integrators = {"auto"};
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  std::vector<std::string> names;
  for (const PlannedIntegrator& p : plan.integrators) names.push_back(p.integrator->name());
  for (const Integrator* i : integrators()) {
    bool explained = false;
    for (const PlanLine& line : plan.lines)
      explained = explained || (line.subject == i->name() && line.reason.size() > 10);
    CHECK_MESSAGE(explained, i->name());
  }
  return names;
}

std::vector<std::string> keptOf(const char* name) {
  return kept(Scene(loadGltf(sourcePath("scenes/" + std::string(name) + ".glb"))));
}

}  // namespace

TEST_CASE("auto leaves photons and light subpaths out where camera paths find all light") {
  for (const char* name : {"cornell", "plates", "interior", "hair", "foliage", "sun_sky", "forest", "bookshelf",
                           "door_ajar", "many_lights"}) {
    CAPTURE(std::string(name));
    CHECK(keptOf(name) == std::vector<std::string>{"pt"});
  }
}

TEST_CASE("auto keeps photons and connections where caustics are much of the light, or come from lights without size") {
  for (const char* name : {"pool", "torus_glass", "glass_of_water", "materials"}) {
    CAPTURE(std::string(name));
    CHECK(keptOf(name) == std::vector<std::string>{"sppm", "bdpt"});
  }
}

TEST_CASE(
    "Connections are kept for caustics that are much of the light or that no camera path finds, else photons alone") {
  SceneTraits traits;
  traits.flags = kTraitEmissiveTriangles;
  LightReach reach;
  reach.caustic = 0.02;
  CHECK(!photonsApply(traits, reach).yes);
  CHECK(!connectionsApply(traits, reach).yes);
  reach.causticVariance = 100;
  CHECK(photonsApply(traits, reach).yes);
  CHECK(!connectionsApply(traits, reach).yes);
  reach.beyondCameraPaths = 0.01;
  CHECK(connectionsApply(traits, reach).yes);
  reach.beyondCameraPaths = 0;
  reach.caustic = 0.07;
  CHECK(!connectionsApply(traits, reach).yes);
  reach.causticBySmooth = 0.07;
  CHECK(connectionsApply(traits, reach).yes);
  reach = LightReach();
  CHECK(!photonsApply(traits, reach).yes);
  CHECK(!connectionsApply(traits, reach).yes);
}

TEST_CASE("auto renders what it keeps: the headline is the photon map's, the shares are in the plan") {
  const Scene scene(loadGltf(sourcePath("scenes/torus_glass.glb")));
  Settings settings = settingsFor(32, 18, 4);
  settings.integrators = {"auto"};
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  CHECK(plan.text().find("passes of a round: sppm 1, bdpt 1") != std::string::npos);
  const RenderResult r = Session(scene, plan).run();
  REQUIRE(r.estimates->estimates.size() == 2);
  CHECK(r.estimates->estimates[0].name == "sppm");
  CHECK(r.estimates->estimates[1].passes == 4);
  CHECK(sameBits(r.image, r.estimates->estimates[0].mean));
}

}  // namespace braid::test_plan
