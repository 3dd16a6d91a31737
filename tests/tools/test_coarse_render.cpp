// SPDX-License-Identifier: Apache-2.0
// A picture for which there is no time for one pass over all pixels: what is rendered, how it fills the image, and what
// its file says.
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <thread>

#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "tests/support/command_line.h"
#include "tests/support/render_fixture.h"
#include "tools/publish/coarse_output.h"
#include "tools/images/estimates_file.h"
#include "tools/run/late_first_pass.h"

namespace braid::test_coarse_render {

using test::braidRun;
using test::contains;
using test::Folder;
using test::Run;

namespace {

const std::string kCornellFile = BRAID_SOURCE_DIR "/scenes/cornell.glb";

struct Cornell {
  Scene scene{cornellBox()};
  const CameraData& camera = scene.data().cameras.at(0);
  Plan plan(const Settings& settings) const { return makePlan(scene, camera, settings, test::integrators()); }
};

Settings settingsOf(int width, int height) {
  Settings s = test::settingsFor(width, height, 1);
  s.keep.features = true;
  s.transparent = true;
  return s;
}

double meanOf(const Plane<float>& p) {
  double sum = 0;
  for (size_t i = 0; i < p.size(); ++i) sum += static_cast<double>(p[i]);
  return sum / static_cast<double>(p.size());
}

}  // namespace

TEST_CASE("Coarse pixels lie below full ones, the first below the first and the last below the last") {
  for (const int full : {1, 2, 7, 16, 135, 1920})
    for (const int divisor : {1, 2, 3, 7, 8}) {
      const int coarse = (full + divisor - 1) / divisor;
      CHECK(coarsePixel(0, full, coarse) == 0);
      CHECK(coarsePixel(full - 1, full, coarse) == coarse - 1);
      for (int x = 1; x < full; ++x) {
        const int step = coarsePixel(x, full, coarse) - coarsePixel(x - 1, full, coarse);
        CHECK((step == 0 || step == 1));
      }
    }
}

TEST_CASE("The window of a coarse plan covers that of the full one, and every pixel there gets a value") {
  const Cornell c;
  for (const int divisor : {2, 5, 8})
    for (const PixelWindow& window : {PixelWindow{0, 0, 101, 67}, {13, 7, 14, 8}, {90, 1, 101, 67}}) {
      Settings s = settingsOf(101, 67);
      s.crop = window;
      s.keep.quarters = s.keep.history = true;
      s.photons = 1000;
      const Plan full = c.plan(s), coarse = coarsePlan(full, c.camera, divisor);
      CHECK(coarse.settings.width == (101 + divisor - 1) / divisor);
      CHECK(coarse.settings.photons == 1000u / static_cast<unsigned>(divisor * divisor));
      CHECK(coarse.buckets() == 2);
      Session session(c.scene, coarse);
      session.advance();
      const Estimates e = enlargedEstimates(session.state(), full);
      CHECK(e.window == window);
      CHECK(e.fullWidth == 101);
      CHECK(e.estimates.front().mean.width() == window.width());
      CHECK(e.estimates.front().passes == 1);
      // What it has not is not made up.
      CHECK(e.estimates.front().half[0].empty());
      CHECK(e.estimates.front().variance.empty());
      REQUIRE(e.features);
      CHECK(e.features->depth.mean.height == window.height());
      CHECK(enlargedAlpha(session.state(), full)->width == window.width());
    }
}

TEST_CASE("An enlarged image is that of the coarse pixels, each in its place") {
  const Cornell c;
  const Plan full = c.plan(settingsOf(64, 48)), coarse = coarsePlan(full, c.camera, 4);
  Session session(c.scene, coarse);
  session.advance();
  const Estimates small = session.estimates(), large = enlargedEstimates(session.state(), full);
  const Plane<float>&from = small.estimates.front().mean[1], &to = large.estimates.front().mean[1];
  bool same = true;
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) same = same && to.at(x, y) == from.at(x / 4, y / 4);
  CHECK(same);
  // The view is the same: the depths of a whole image agree.
  Session whole(c.scene, full);
  whole.advance();
  CHECK(meanOf(large.features->depth.mean) ==
        doctest::Approx(meanOf(whole.estimates().features->depth.mean)).epsilon(0.05));
}

TEST_CASE("With time for everything the full image is rendered, with none the coarsest one is there") {
  const Cornell c;
  Settings s = settingsOf(160, 120);
  const Plan plan = c.plan(s);
  const CoarseRender rich(c.scene, c.camera, plan, [] { return 1e9; });
  CHECK(rich.fullRoundFits());
  CHECK(rich.report().spp == 2);
  CoarseRender poor(c.scene, c.camera, plan, [] { return -1.0; });
  CHECK_FALSE(poor.fullRoundFits());
  poor.refine(0);
  CHECK(poor.report().spp == 1);
  CHECK(poor.state().fullWidth == 20);
  // Time for one of a quarter of the pixels or so: finer than the coarsest, whatever the machine.
  CoarseRender some(c.scene, c.camera, plan, [] { return 1e9; });
  some.refine(1e9);
  CHECK(some.state().fullWidth == 80);
  CHECK(some.report().spp == 1);
}

TEST_CASE("A first pass that is late is dropped where there is another picture, and never counts") {
  const Cornell c;
  Session session(c.scene, c.plan(settingsOf(640, 480)));
  LateFirstPass late(TimeLimit(1e-9), session, true, true, 1e3);
  while (!late.dropped()) std::this_thread::yield();
  JsonLog json("");
  const RunReport report = session.advance(
      [&](const Progress& p) {
        late.over(p.round, json);
        return !late.dropped();
      },
      nullptr, &late.dropped());
  CHECK(report.rounds == 0);
  CHECK(session.state().rounds() == 0);
  CHECK(late.dropped());
  // One that was done just then stays, and the passes after it go on.
  late.over(0, json);
  LateFirstPass nearly(TimeLimit(1e-9), session, true, true, 1e3);
  while (!nearly.dropped()) std::this_thread::yield();
  nearly.over(1, json);
  CHECK_FALSE(nearly.dropped());
}

TEST_CASE("A limit too short for one pass gives a coarse picture, whose file and user are told") {
  const Folder folder;
  const std::string file = folder.path / "o.exr";
  const std::string common = "render '" + kCornellFile + "' --threads 1 -o o.exr --size 640x360 --time 0.001 ";
  const Run run = braidRun(folder, common + "--aovs all --quarters --png o.png --integrator pt,bdpt");
  CHECK(run.code == 0);
  CHECK(contains(run.err, "80x45 were rendered in the place of 640x360"));
  CHECK(contains(run.err, "is not combined"));
  CHECK(contains(run.err, "stopped by time: o.exr, o.png"));
  const ImageFile image = readImage(file);
  CHECK(image.width == 640);
  CHECK(image.planes.count("R") == 1);
  CHECK(image.planes.count("Albedo.R") == 1);
  CHECK(image.planes.count("pt.halfA.R") == 0);
  CHECK(image.planes.count("Error.Y") == 0);
  CHECK(std::any_of(image.attributes.begin(), image.attributes.end(),
                    [](const Attribute& a) { return a.name == kRenderedSizeAttribute && a.text == "80x45"; }));
  const Plane<float>& red = image.planes.at("R");
  std::set<float> values;
  for (size_t i = 0; i < red.size(); ++i) values.insert(red[i]);
  CHECK(values.size() > 100);
  CHECK(values.size() <= 80 * 45);
  CHECK(meanOf(red) > 0.01);
  // Copies are no samples for combiners.
  const Run combine = braidRun(folder, "combine --unbiased o.exr --method nlm -o c.exr");
  CHECK(combine.code == 2);
  CHECK(contains(combine.err, "o.exr: its pixels are copies of those of an image of 80x45"));
}

}  // namespace braid::test_coarse_render
