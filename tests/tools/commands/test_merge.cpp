// SPDX-License-Identifier: Apache-2.0
// Checkpoints, shares and `braid merge` on the command line: what comes out is what one uninterrupted run gives, and
// what does not belong together is refused with a sentence.
#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "renderer/film/files/state_file.h"
#include "tests/support/command_line.h"

namespace braid::test_merge {

using test::braidRun;
using test::contains;
using test::Folder;
using test::readText;
using test::Run;

namespace {

const std::string kCornell = "'" BRAID_SOURCE_DIR "/scenes/cornell.glb'";
const std::string kView = " -q --size 26x17 --integrator pt,sppm --transparent --reproducible ";

void must(const Folder& folder, const std::string& arguments) {
  const Run run = braidRun(folder, arguments);
  INFO(arguments);
  INFO(run.err);
  REQUIRE(run.code == 0);
  CHECK(run.err.empty());
}

std::string render(const std::string& rest) { return "render " + kCornell + test::plainly(kView + rest); }

// One line on standard error with this exit code.
std::string refusal(const Folder& folder, const std::string& arguments, int code) {
  const Run run = braidRun(folder, arguments);
  INFO(arguments);
  INFO(run.err);
  CHECK(run.code == code);
  CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 1);
  return run.err;
}

double largestDifference(const Plane<float>& a, const Plane<float>& b) {
  REQUIRE(a.size() == b.size());
  double most = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const double x = static_cast<double>(a[i]), y = static_cast<double>(b[i]);
    if (x != y) most = std::max(most, std::fabs(x - y) / std::max({std::fabs(x), std::fabs(y), 1e-6}));
  }
  return most;
}

}  // namespace

TEST_CASE("Shares merged in any order are the unsplit run: means exactly, combined images to rounding") {
  const Folder folder;
  const std::string combine = " --combine js --biased box --quarters --history ";
  must(folder, render("--spp 13 -o whole.exr --png whole.png" + combine));
  must(folder, render("--passes 0:4 --checkpoint a.state" + combine));
  must(folder, render("--passes 4:5 --checkpoint b.state" + combine));
  must(folder, render("--passes 5:13 --checkpoint c.state -o c.exr" + combine));
  const std::string merge = " -q --reproducible --checkpoint all.state --png merged.png" + combine;
  must(folder, "merge c.state a.state b.state -o merged.exr" + merge);
  must(folder, "merge a.state b.state c.state -o again.exr" + merge);
  CHECK((readText(folder.path / "merged.exr") == readText(folder.path / "again.exr")));

  const ImageFile whole = readImage(folder.path / "whole.exr"), merged = readImage(folder.path / "merged.exr");
  size_t combined = 0;
  for (const auto& [name, plane] : whole.planes) {
    INFO(name);
    const bool history = contains(name, ".variance4") || contains(name, ".variance8");  // not additive
    if (history) continue;
    REQUIRE(merged.planes.count(name) == 1);
    const bool mean = contains(name, ".mean") || contains(name, ".half") || contains(name, ".q") || name == "A";
    if (mean)
      CHECK(merged.planes.at(name).data == plane.data);
    else
      CHECK(largestDifference(merged.planes.at(name), plane) < 2e-3);  // R G B are half floats
    combined += contains(name, "combined.js");
  }
  CHECK(combined == 3);
  const auto attribute = [](const ImageFile& file, const std::string& name) {
    for (const Attribute& a : file.attributes)
      if (a.name == name) return a.text + std::to_string(a.integer);
    return std::string("none");
  };
  for (const char* name : {"samplesPerPixel", "braid/sceneHash", "braid/planHash", "braid/pt/passes", "braid/plan"})
    CHECK_MESSAGE(attribute(whole, name) == attribute(merged, name), name);

  // The merged state goes on as the unsplit one would.
  must(folder, render("--spp 15 -o on.exr --checkpoint all.state --resume" + combine));
  must(folder, render("--spp 15 -o whole15.exr" + combine));
  CHECK(readImage(folder.path / "on.exr").planes.at("pt.mean.G").data ==
        readImage(folder.path / "whole15.exr").planes.at("pt.mean.G").data);
  CHECK(readStateFile(folder.path / "all.state").estimates[1].passes[0] == PassInterval{0, 15});
}

TEST_CASE("A resumed command gives the very file of an uninterrupted one") {
  const Folder folder;
  must(folder, render("--spp 9 -o whole.exr --history --quarters"));
  const std::string job = render("--checkpoint run.state --resume -o run.exr --history --quarters");
  must(folder, job + " --spp 2 --threads 1");  // nothing to resume yet
  must(folder, job + " --spp 5 --threads 2");
  must(folder, job + " --spp 5");  // nothing left to do
  must(folder, render("--resume run.state --spp 9 -o run.exr --history --quarters"));
  CHECK((readText(folder.path / "run.exr") == readText(folder.path / "whole.exr")));
  CHECK(readStateHeader(folder.path / "run.state").estimates[0].passes[0] == PassInterval{0, 5});
  // A share, interrupted.
  must(folder, render("--passes 3:9 --checkpoint whole.state"));
  must(folder, render("--passes 3:5 --checkpoint part.state"));
  must(folder, render("--passes 3:9 --checkpoint part.state --resume"));
  const FilmState a = readStateFile(folder.path / "whole.state"), b = readStateFile(folder.path / "part.state");
  CHECK(b.estimates[0].passes[0] == PassInterval{3, 9});
  for (size_t k = 0; k < 2; ++k) CHECK(a.estimates[1].sums.sums()[k][1].data == b.estimates[1].sums.sums()[k][1].data);
}

TEST_CASE("What a run keeps without being asked again is what the state holds") {
  const Folder folder;
  must(folder, render("--spp 4 --checkpoint run.state --quarters --history"));
  must(folder, render("--spp 6 --checkpoint run.state --resume --aovs none -o out.exr"));
  const FilmState state = readStateHeader(folder.path / "run.state");
  CHECK(state.buckets == 4);
  CHECK(state.estimates[0].history.size() == 3);
}

TEST_CASE("Runs that cannot be resumed or merged are refused with a sentence") {
  const Folder folder;
  must(folder, render("--spp 2 --checkpoint a.state -o a.exr"));
  const auto resume = [&](const std::string& rest, int code = 2) {
    return refusal(folder, render("--resume a.state --spp 3 -o b.exr " + rest), code);
  };
  CHECK(contains(resume("--max-depth 3"), "a.state: cannot be resumed: --max-depth was 32 and is 3"));
  CHECK(contains(resume("--light-scale 2"), "--light-scale was 1 and is 2"));
  CHECK(contains(resume("--yfov 20"), "the camera was "));
  CHECK(contains(resume("--isa sse4.2"), "--isa was "));
  CHECK(contains(refusal(folder,
                         "render '" BRAID_SOURCE_DIR "/scenes/furnace.glb'" + kView +
                             "--combine none --resume a.state --spp 3 -o b.exr",
                         2),
                 "the scene's content was "));
  CHECK(contains(refusal(folder, render("--resume none.state -o b.exr"), 2), "none.state: does not exist"));
  CHECK(contains(refusal(folder, render("--resume a.exr -o b.exr"), 2), "a.exr: is no state of braid"));
  CHECK(contains(refusal(folder, render("-o b.exr --resume"), 1), "--resume: name a file"));
  CHECK(contains(refusal(folder, render("--spp 2"), 1), "nothing to write"));
  CHECK(contains(refusal(folder, render("--spp 2 --passes 0:3 -o b.exr"), 1), "--passes alone says how many"));
  for (const char* passes : {"3", "3:", ":3", "3:3", "4:3", "0:3x", "-1:3", "0:99999999999999999999"})
    CHECK(contains(refusal(folder, render(std::string("-o b.exr --passes ") + passes), 1), "expected FIRST:END"));
  CHECK(contains(refusal(folder, render("--passes 4:9 --resume a.state -o b.exr"), 2), "holds the passes 0:2 of pt"));

  must(folder, render("--passes 1:3 --checkpoint b.state"));
  must(folder, render("--passes 3:4 --checkpoint c.state --seed 5"));
  CHECK(contains(refusal(folder, "merge a.state b.state -o m.exr", 2), "overlap: both hold the passes 1:2 of pt"));
  CHECK(contains(refusal(folder, "merge a.state c.state -o m.exr", 2),
                 "are not shares of one render: --seed was 0 and is 5"));
  CHECK(contains(refusal(folder, "merge a.state a.exr -o m.exr", 2), "a.exr: is no state of braid"));
  CHECK(contains(refusal(folder, "merge a.state none.state -o m.exr", 2), "none.state: does not exist"));
  CHECK(contains(refusal(folder, "merge a.state", 1), "nothing to write"));
  CHECK(contains(refusal(folder, "merge a.state -o m.exr --combine magic", 1), "magic"));
  CHECK(contains(refusal(folder, "merge a.state -o m.exr --combine uncorrelated", 2), "cannot run on these shares"));
  CHECK(contains(refusal(folder, "merge a.state -o no/m.exr", 3), "folder"));
  CHECK(braidRun(folder, "merge").code == 1);
  CHECK(!std::filesystem::exists(folder.path / "m.exr"));
  CHECK(!std::filesystem::exists(folder.path / "b.exr"));
}

}  // namespace braid::test_merge
