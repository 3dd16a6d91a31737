// SPDX-License-Identifier: Apache-2.0
// The image of the stop of denoising survives files, interruptions and shares.
#include <doctest/doctest.h>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/film/files/state_file.h"
#include "tests/combiners/blending/denoise_cutoff.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/command_line.h"
#include "tests/support/render_fixture.h"
#include "tools/images/estimates_file.h"

namespace braid::test_denoise_cutoff_files {

using namespace test::denoise_cutoff;
using test::Folder;
using test::identical;

namespace {

const Scene& cornell() {
  static const Scene built(cornellBox());
  return built;
}

Settings stoppingSettings(uint64_t spp) {
  Settings s = test::settingsFor(24, 18, spp);
  s.integrators = {"pt"};
  s.keep = {.features = true, .history = true, .stops = {7}};
  return s;
}

Session sessionFor(const Settings& s) {
  return Session(cornell(), makePlan(cornell(), cornell().data().cameras.at(0), s, test::integrators()));
}

FilmState stateOf(const Settings& s) {
  Session session = sessionFor(s);
  session.run();
  return session.state();
}

}  // namespace

TEST_CASE("The film keeps the image of the first checkpoint with enough passes; files and resuming keep it too") {
  const FilmState whole = stateOf(stoppingSettings(20));
  const auto eight = test::render(cornell(), stoppingSettings(8)).estimates;
  const std::vector<Checkpoint>& history = whole.estimates[0].history;
  REQUIRE(history.size() == 5);
  for (const Checkpoint& c : history) CHECK(c.mean.empty() == (c.passes != 8));
  CHECK(identical(history[3].mean, eight->estimates[0].mean));
  for (int h = 0; h < 2; ++h) CHECK(identical(history[3].half[h], eight->estimates[0].half[h]));
  CHECK(identical(history[3].variance, eight->estimates[0].variance));

  const Folder folder;
  const Estimates inProcess = estimatesOf(whole, false);
  const MethodResult combined = curvesOf(inProcess, 7);
  REQUIRE(remark(combined, "stoppedAfter"));
  CHECK(remark(combined, "stoppedAfter")->integer == 8);
  for (const uint64_t first : {5, 11}) {  // before and after the stop
    const std::string file = folder.path / "part.state";
    writeStateFile(file, stateOf(stoppingSettings(first)));
    Session session = sessionFor(stoppingSettings(20));
    session.resume(readStateFile(file), "part");
    session.run();
    CHECK(identical(curvesOf(*session.snapshot(), 7).image.mean, combined.image.mean));
  }
  // A run that keeps no image is another one: its state would lack what is to be blended.
  Settings without = stoppingSettings(20);
  without.keep.stops.clear();
  CHECK_THROWS_AS(sessionFor(without).resume(whole, "whole"), Error);

  ExrOptions options;
  options.history = true;
  Estimates written = inProcess;
  written.attributes = estimateAttributes(written);
  writeExr(folder.path / "out.exr", written, written.estimates[0].mean, nullptr, options);
  const Estimates read = readEstimates(readImage(folder.path / "out.exr"));
  CHECK(read.estimates.size() == 1);
  const MethodResult offline = curvesOf(read, 7);
  CHECK(identical(offline.image.mean, combined.image.mean));
  CHECK(identical(offline.image.half[0], combined.image.half[0]));
  CHECK(identical(offline.error, combined.error));
}

TEST_CASE("Shares add up to the image of the first of them that have passes enough") {
  const auto shareOf = [](uint64_t begin, uint64_t end) {
    Settings s = stoppingSettings(end - begin);
    s.firstRound = begin;
    return stateOf(s);
  };
  FilmState sum = shareOf(0, 5);
  for (const uint64_t begin : {5, 10, 15}) addShare(sum, shareOf(begin, begin + 5));
  const auto ten = test::render(cornell(), stoppingSettings(10)).estimates;
  size_t images = 0;
  for (const Checkpoint& c : sum.estimates[0].history) {
    if (c.mean.empty()) continue;
    ++images;
    CHECK(c.passes == 10);
    CHECK(identical(c.mean, ten->estimates[0].mean));
  }
  CHECK(images == 1);
  CHECK(remark(curvesOf(estimatesOf(sum, false), 7), "stoppedAfter")->integer == 10);
}

TEST_CASE("On the command line: combined later from the file, the stopped image is the same bit for bit") {
  const Folder folder;
  const auto must = [&](const std::string& arguments) {
    const test::Run run = test::braidRun(folder, arguments);
    INFO(arguments, "\n", run.err);
    REQUIRE(run.code == 0);
    return run.err;
  };
  const std::string view = "render '" BRAID_SOURCE_DIR
                           "/scenes/cornell.glb' -q --size 24x18 --integrator pt --combine curves ",
                    stop = "--biased box --curves-stop 8 --float --history --reproducible ";
  must(view + stop + "--spp 24 -o whole.exr");
  must("combine -q --float --unbiased whole.exr --method curves --biased box --curves-stop 8 -o later.exr");
  must("combine -q --float --unbiased whole.exr --method curves:8@box -o named.exr");
  const ImageFile whole = readImage(folder.path / "whole.exr");
  CHECK(hasLayer(whole, "pt.mean8"));
  CHECK(identical(whole.rgb(), readImage(folder.path / "later.exr").rgb()));
  CHECK(identical(whole.rgb(), readImage(folder.path / "named.exr").rgb()));
  CHECK_FALSE(hasLayer(whole, "box.mean"));  // nothing is denoised anew

  must(view + "--biased box --float --history --spp 24 -o never.exr");
  CHECK_FALSE(identical(whole.rgb(), readImage(folder.path / "never.exr").rgb()));
  must(view + "--biased box --float --spp 8 -o short.exr");
  must(view + stop + "--spp 8 -o before.exr");
  CHECK(identical(readImage(folder.path / "short.exr").rgb(), readImage(folder.path / "before.exr").rgb()));

  must(view + stop + "--spp 11 --checkpoint run.state -o run.exr");
  must(view + stop + "--spp 24 --checkpoint run.state --resume -o run.exr");
  CHECK((test::readText(folder.path / "run.exr") == test::readText(folder.path / "whole.exr")));
  const std::string lost = must("combine --float --unbiased never.exr --method curves:8@box -o a.exr");
  CHECK(lost.find("that of pt after 8 passes was not kept") != std::string::npos);
}

}  // namespace braid::test_denoise_cutoff_files
