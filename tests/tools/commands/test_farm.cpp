// SPDX-License-Identifier: Apache-2.0
// `braid plan --tasks N --format ...`: jobs for farms, their shares, their options, and the job for make, which is run.
#include <doctest/doctest.h>

#include <algorithm>

#include "renderer/film/files/exr.h"
#include "tests/support/command_line.h"
#include "tools/commands/farm_job.h"
#include "tests/tools/commands/farm_jobs.h"

namespace braid::test_farm {

using namespace test::farm_jobs;
using test::braidRun;
using test::contains;
using test::Folder;
using test::readText;
using test::Run;

namespace {

const std::string kCornell = "'" BRAID_SOURCE_DIR "/scenes/cornell.glb'";

}  // namespace

TEST_CASE("Passes are split without gaps, nearly equally, and so that quarters and halves stay equal") {
  for (uint64_t spp = 1; spp <= 70; ++spp)
    for (uint64_t tasks = 1; tasks <= spp; ++tasks) {
      CAPTURE(spp);
      CAPTURE(tasks);
      const std::vector<PassInterval> shares = splitPasses(spp, tasks);
      REQUIRE(shares.size() == tasks);
      CHECK(shares.front().begin == 0);
      CHECK(shares.back().end == spp);
      const uint64_t unit = spp >= 4 * tasks ? 4 : spp >= 2 * tasks ? 2 : 1;
      uint64_t least = spp, most = 0;
      for (size_t k = 0; k < tasks; ++k) {
        if (k > 0) CHECK(shares[k].begin == shares[k - 1].end);
        CHECK(shares[k].count() > 0);
        CHECK(shares[k].begin % unit == 0);
        least = std::min(least, shares[k].count());
        most = std::max(most, shares[k].count());
      }
      CHECK(most - least <= unit);
    }
  CHECK_THROWS(splitPasses(3, 4));
  CHECK_THROWS(splitPasses(3, 0));
}

TEST_CASE("make runs every share and then the merge with the very arguments, whatever their characters") {
  const UglyJob ugly;
  ugly.print(FarmFormat::Make, "job.mk");
  must(ugly.folder, "make -j3 -f job.mk");
  ugly.check(ugly.calls(), "");
}

TEST_CASE("A job printed by plan for make gives the image of the unsplit render, also in a second go") {
  const Folder folder;
  const std::string inner = "a b's größe";
  std::filesystem::create_directory(folder.path / inner);
  std::filesystem::copy_file(BRAID_SOURCE_DIR "/scenes/cornell.glb", folder.path / inner / "-box.glb");
  const std::string render =
      " -q --size 26x17 --integrator pt,crn --max-depth 5 --seed 3 --spp 10 --transparent --combine "
      "js,uncorrelated --biased box --history --aovs all ";
  const std::string at = "cd \"" + inner + "\" && ";
  const Run plan = braidRun(folder,
                            "plan ./-box.glb" + render +
                                "--threads 1 --output=-out.exr --png 'p $x.png' --tasks 4 --format make --reproducible",
                            at);
  INFO(plan.err);
  REQUIRE(plan.code == 0);
  write(folder.path / "job.mk", plan.out);
  CHECK(contains(plan.out, "--passes=0:4 --checkpoint=-out.shard0.state"));
  CHECK(contains(plan.out, "--passes=8:10 --checkpoint=-out.shard3.state"));
  must(folder, "make -j4 -f job.mk");
  const Run whole = braidRun(folder, "render ./-box.glb" + render + "-o whole.exr --reproducible", at);
  INFO(whole.err);
  REQUIRE(whole.code == 0);
  const ImageFile a = readImage(folder.path / inner / "whole.exr"), b = readImage(folder.path / inner / "-out.exr");
  size_t means = 0;
  for (const auto& [name, plane] : a.planes) {
    INFO(name);
    if (contains(name, ".variance")) continue;
    REQUIRE(b.planes.count(name) == 1);
    const Plane<float>& other = b.planes.at(name);
    if (name.starts_with("pt.") || name.starts_with("crn.") || name == "A") {  // means and halves
      CHECK(other.data == plane.data);
      ++means;
    }
    if (contains(name, "combined."))
      for (size_t i = 0; i < plane.size(); ++i)
        CHECK(std::fabs(other[i] - plane[i]) <= 1e-3f * std::max(1.0f, std::fabs(plane[i])));
  }
  CHECK(means == 2 * 9 + 1);
  CHECK(std::filesystem::exists(folder.path / inner / "p $x.png"));
  // A second go makes what is missing.
  const std::string first = readText(folder.path / inner / "-out.exr");
  std::filesystem::remove(folder.path / inner / "-out.shard2.state");
  std::filesystem::remove(folder.path / inner / "-out.exr");
  must(folder, "make -j2 -f job.mk");
  CHECK((readText(folder.path / inner / "-out.exr") == first));
}

TEST_CASE("Every option given to plan is carried on, and none that a share or the merge would refuse") {
  const Folder folder;
  // Short shares of a method that needs quarters and history: each is told to keep what only the whole render needs.
  const std::string options =
      "plan " + kCornell +
      " -q --size 26x17 --spp 8 --yfov 40 --light-scale 2 --no-default-light --sampler independent "
      "--aovs features --float --exposure 1 --combine auto,uncorrelated,curves --biased box "
      "--integrator pt,crn --save-every 10 --checkpoint all.state -o out.exr --tasks 4 ";
  const Run run = braidRun(folder, options + "--format make --program 'my braid'");
  INFO(run.err);
  REQUIRE(run.code == 0);
  const std::string share =
      run.out.substr(run.out.find("share0:\n"), run.out.find("share1:\n") - run.out.find("share0:\n"));
  for (const char* text :
       {"'my braid' render ", " --size=26x17 ", " --yfov=40 ", " --light-scale=2 ", " --no-default-light ",
        " --sampler=independent ", " --quarters ", " --direct-indirect ", " --aovs=features ", " --save-every=10 ",
        " --quiet ", " --combine=auto,uncorrelated,curves ", " --biased=box ", " --resume ", " --passes=0:2 ",
        " --history "})
    CHECK_MESSAGE(contains(share, text), text);
  for (const char* text : {"--spp", "--exposure", "--float", "--tasks", "--format", "--output"})
    CHECK_MESSAGE(!contains(share, text), text);
  const std::string merge =
      run.out.substr(run.out.find("merge: share"), run.out.find("share0:\n") - run.out.find("merge: share"));
  for (const char* text : {" --output=out.exr ", " --float", " --exposure=1", " --aovs=features", " --biased=box ",
                           " --checkpoint=all.state", " --quiet"})
    CHECK_MESSAGE(contains(merge, text), text);
  CHECK(!contains(merge, "--size"));
  const Run real = braidRun(folder, options + "--format make");
  write(folder.path / "job.mk", real.out);
  must(folder, "make -f job.mk");
  CHECK(std::filesystem::exists(folder.path / "all.state"));
}

TEST_CASE("Jobs that could not run are refused with a sentence") {
  const Folder folder;
  const auto refusal = [&](const std::string& rest) {
    const Run run = braidRun(folder, "plan " + kCornell + " -q " + rest);
    INFO(rest);
    INFO(run.err);
    CHECK(run.code == 1);
    CHECK(run.out.empty());
    return run.err;
  };
  CHECK(contains(refusal("--tasks 2 -o a.exr"), "give --format slurm, opencue, flamenco or make"));
  CHECK(contains(refusal("--format make -o a.exr"), "give --tasks"));
  CHECK(contains(refusal("--tasks 2 --format pbs -o a.exr"), "unknown format 'pbs'"));
  CHECK(contains(refusal("--tasks 2 --format make"), "name the merged image"));
  CHECK(contains(refusal("--tasks 2 --format make -o a.exr --time 1h"), "give --spp alone"));
  CHECK(contains(refusal("--tasks 9 --spp 8 --format make -o a.exr"), "expected 1 to 8"));
  CHECK(contains(refusal("--tasks 2 --format make -o a.exr --json"), "a job is no JSON"));
  CHECK(contains(refusal("--tasks 2 --format make -o a.exr --combine uncorrelated"), "cannot run"));
  CHECK(contains(refusal("--tasks 2 --format make -o \"$(printf 'a\\nb').exr\""), "control characters"));
  CHECK(contains(refusal("--tasks 2 --format opencue -o \"$(printf 'a\\377b').exr\""), "not UTF-8"));
  CHECK(contains(refusal("--tasks 2 --format opencue -o " + std::string(900, 'a') + ".exr --png " +
                         std::string(2000, 'b') + " --layer-prefix " + std::string(2000, 'c')),
                 "at most 4000 characters"));
}

}  // namespace braid::test_farm
