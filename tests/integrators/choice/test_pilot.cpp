// SPDX-License-Identifier: Apache-2.0
// What a pilot makes of the integrators that traits and the reach of light leave open: which it leaves out, that
// threads, samples and machines agree, and where there is none.
#include <algorithm>

#include <doctest/doctest.h>

#include "renderer/scene/data/gltf.h"
#include "renderer/session/pixel_options.h"
#include "tests/integrators/choice/glazed_room.h"

namespace braid::test_pilot {

using namespace test;

namespace {

const Scene& room() {
  static const Scene scene(glazedRoom());
  return scene;
}

Settings automatic(int width, int height, uint64_t spp = 64) {
  Settings s = settingsFor(width, height, spp);
  s.integrators = {"auto"};
  return s;
}

Plan planOf(const Scene& scene, const Settings& settings) {
  return makePlan(scene, scene.data().cameras.at(0), settings, integrators());
}

bool keeps(const Plan& plan, const std::string& name) {
  return std::any_of(plan.integrators.begin(), plan.integrators.end(),
                     [&](const PlannedIntegrator& p) { return p.integrator->name() == name; });
}

const PlanLine* lineOf(const Plan& plan, const std::string& subject) {
  const auto line =
      std::find_if(plan.lines.begin(), plan.lines.end(), [&](const PlanLine& l) { return l.subject == subject; });
  return line == plan.lines.end() ? nullptr : &*line;
}

}  // namespace

TEST_CASE("In a room that the sun lights through a pane, a pilot leaves photons out, with the number that says so") {
  const Plan before = planOf(room(), automatic(160, 90)), plan = planOf(room(), automatic(240, 180));
  CAPTURE(plan.text());
  CHECK(keeps(before, "sppm"));  // as there is no pilot
  CHECK_FALSE(keeps(plan, "sppm"));
  REQUIRE(plan.integrators.size() == 1);
  CHECK(plan.integrators[0].integrator->unbiased());
  REQUIRE(lineOf(plan, "sppm"));
  CHECK(lineOf(plan, "sppm")->reason.find("times the error") != std::string::npos);
  REQUIRE(lineOf(plan, "pilot"));
  CHECK(lineOf(plan, "pilot")->kept);
  CHECK(lineOf(plan, "pilot")->reason.find("rays a sample") != std::string::npos);
  CHECK(planOf(room(), automatic(240, 180)).text() == plan.text());
}

TEST_CASE("Where light samples find the faint caustic, for the ball is a little rough, paths alone are taken") {
  const Scene rough(glazedRoom(0.05f));
  const Plan plan = planOf(rough, automatic(240, 180));
  CAPTURE(plan.text());
  REQUIRE(plan.integrators.size() == 1);
  CHECK(keeps(plan, "pt"));
  CHECK(lineOf(plan, "pilot") == nullptr);
}

TEST_CASE("A pilot keeps photons where a glass throws caustics") {
  const Scene scene(loadGltf(sourcePath("scenes/torus_glass.glb")));
  const Plan plan = planOf(scene, automatic(240, 135));
  CAPTURE(plan.text());
  CHECK(keeps(plan, "sppm"));
  CHECK(plan.integrators.size() == 2);
  REQUIRE(lineOf(plan, "pilot"));
  CHECK(lineOf(plan, "pilot")->kept);
}

TEST_CASE("A pilot decides alike on any number of threads") {
  Settings settings = automatic(192, 108);
  settings.threads = 1;
  const std::string alone = planOf(room(), settings).text();
  CHECK(alone.find("+ pilot: ") != std::string::npos);
  for (const int threads : {2, 5}) {
    settings.threads = threads;
    CHECK(planOf(room(), settings).text() == alone);
  }
}

TEST_CASE("Shares, resumed renders and crops decide as the whole render does") {
  const Settings whole = automatic(192, 108, 4096);
  const auto namesOf = [&](const Settings& s) {
    std::string names;
    for (const StateOption& option : pixelOptions(planOf(room(), s)))
      if (option.name == "--integrator") names = option.value;
    return names;
  };
  const std::string names = namesOf(whole);
  CHECK(names.find("sppm") == std::string::npos);
  Settings share = whole, crop = whole;
  share.firstRound = 8;
  share.spp = 2;
  share.goesOn = true;
  CHECK(namesOf(share) == names);
  crop.crop = PixelWindow{10, 20, 40, 30};
  CHECK(namesOf(crop) == names);

  // Two shares of one round add up, and the first one goes on to the same film.
  share.firstRound = 0;
  share.spp = 1;
  share.crop = crop.crop;
  Session first(room(), planOf(room(), share));
  first.advance();
  Settings later = share;
  later.firstRound = 1;
  Session second(room(), planOf(room(), later));
  second.advance();
  CHECK(difference(first.state().identity, second.state().identity, true).empty());
  share.spp = 2;
  Session resumed(room(), planOf(room(), share));
  resumed.resume(first.state(), "first.state");
  resumed.advance();
  FilmState sum = first.release();
  addShare(sum, second.release());
  REQUIRE(sum.estimates.size() == resumed.state().estimates.size());
  CHECK(sameBits(sum.estimates[0].sums.mean(), resumed.state().estimates[0].sums.mean()));
}

TEST_CASE("There is no pilot for small frames, few samples, integrators that are named, and where nothing is open") {
  CHECK_FALSE(lineOf(planOf(room(), automatic(160, 90)), "pilot")->kept);
  CHECK_FALSE(lineOf(planOf(room(), automatic(240, 135, 8)), "pilot")->kept);
  for (const char* names : {"sppm", "pt", "bdpt"}) {
    Settings named = automatic(240, 135);
    named.integrators = {names};
    const Plan plan = planOf(room(), named);
    CHECK(lineOf(plan, "pilot") == nullptr);
    CHECK(keeps(plan, names));
  }
  Settings both = automatic(240, 180);
  both.integrators = {"auto", "sppm"};
  CHECK(keeps(planOf(room(), both), "sppm"));
  const Scene box(cornellBox());
  CHECK(lineOf(planOf(box, automatic(240, 135)), "pilot") == nullptr);
}

}  // namespace braid::test_pilot
