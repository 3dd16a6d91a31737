// SPDX-License-Identifier: Apache-2.0
// --memory-limit: kept before anything is rendered where the plan knows, and by the system beyond that. Never a crash.
#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "tests/support/command_line.h"
#include "tests/support/contains.h"
#include "tools/options/memory_limit.h"

namespace braid::test_memory_limit {

using namespace test;

namespace {

const std::string kScene = "'" BRAID_SOURCE_DIR "/scenes/cornell.glb' ";

}  // namespace

TEST_CASE("memory limits: sizes are read with their units") {
  CHECK(parseBytes("512M") == uint64_t(512) << 20);
  CHECK(parseBytes("1.5G") == uint64_t(1536) << 20);
  CHECK(parseBytes("2GiB") == uint64_t(2) << 30);
  CHECK(parseBytes("192M") == uint64_t(192) << 20);
  for (const char* wrong : {"", "5", "G", "1X", "-1G", "nan", "1 G", "191M", "1e9T"})
    CHECK_THROWS_AS(parseBytes(wrong), Error);
}

TEST_CASE("memory limits: what the plan exceeds is refused before rendering, by name") {
  const Folder folder;
  for (const auto& [methods, most] : {std::pair("js@nfor", "combining"), {"auto", "film"}, {"none", "film"}}) {
    const Run run = braidRun(
        folder, "render " + kScene + "--size 4096x2160 --combine " + methods + " -o out.exr --memory-limit 1G");
    CHECK(run.code == 5);
    CHECK(run.err.find(std::string("for ") + most +
                       ", and the limit is 1024 MiB: lower --size or raise --memory-limit") != std::string::npos);
    CHECK(run.err.find('\n') == run.err.size() - 1);
  }
  CHECK_FALSE(std::filesystem::exists(folder.path / "out.exr"));
  // A limit from outside is the same.
  CHECK(
      braidRun(folder, "render " + kScene + "--size 4096x2160 --combine auto -o out.exr", "ulimit -d 1000000; ").code ==
      5);
}

TEST_CASE("memory limits: at any limit a run ends well or with exit code 5 and one line") {
  const Folder folder;
  int refused = 0, done = 0;
  for (int megabytes = 192; megabytes <= 304; megabytes += 16) {
    const Run run = braidRun(folder, "render " + kScene +
                                         "--size 400x300 --spp 2 --combine auto -o out.exr --quiet --memory-limit " +
                                         std::to_string(megabytes) + "M");
    INFO(megabytes, " MiB: ", run.err);
    CHECK((run.code == 0 || run.code == 5));
    if (run.code == 5) CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 1);
    (run.code == 0 ? done : refused)++;
  }
  CHECK(refused > 0);
  CHECK(done > 0);
}

TEST_CASE("memory limits: helpers that do not fit are left out, which the plan says") {
  const Folder folder;
  const std::string view = kScene + "--size 64x48 --spp 4";
  const std::string plan = braidRun(folder, "plan " + view).out;
  if (!contains(plan, "+ kpn: ")) return;  // a machine without networks
  const std::string limited = braidRun(folder, "plan " + view + " --threads 8 --memory-limit 300M").out;
  CHECK(contains(limited, "- kpn: takes more memory than the limit allows\n"));
  CHECK(contains(limited, "+ auto: of pt\n"));
  CHECK(braidRun(folder, "render " + view + " -o out.exr --memory-limit 300M --threads 8").code == 0);
}

TEST_CASE("memory limits: what does not fit is refused while it is read") {
  const Folder folder;
  Estimates frame;
  frame.width = frame.fullWidth = 8192;
  frame.height = frame.fullHeight = 4096;
  frame.window = {0, 0, frame.width, frame.height};
  const Rgb<float> black(frame.width, frame.height);
  writeExr((folder.path / "sky.exr").string(), frame, black, nullptr, {});
  const Run run = braidRun(folder, "info " + kScene + "--env sky.exr --memory-limit 192M");
  CHECK(run.code == 5);
  CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 1);
  CHECK(braidRun(folder, "info " + kScene + "--env sky.exr --memory-limit 1G").code == 0);
}

}  // namespace braid::test_memory_limit
