// SPDX-License-Identifier: Apache-2.0
// `braid render --frames`: frames are those of separate runs, finished ones are left, unfinished ones gone on from.
#include <doctest/doctest.h>

#include <csignal>
#include <memory>

#include <fmt/format.h>

#include "renderer/film/files/exr.h"
#include "renderer/film/files/state_file.h"
#include "tests/support/running_braid.h"

namespace braid::test_frames_cli {

using test::braidRun;
using test::contains;
using test::Folder;
using test::readText;
using test::Run;

namespace {

// A square that moves before a camera of the command line.
std::string movingScene(const Folder& folder) {
  test::GltfFile file = test::quadFile();
  const int times = file.accessor<float>({0, 1}, "SCALAR");
  const int moves = file.accessor<float>({0, 0, 0, 1, 0.5, 0}, "VEC3");
  file.append("animations", {{"name", "move"},
                             {"samplers", {{{"input", times}, {"output", moves}}}},
                             {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}});
  return folder.write("moving.glb", file.glb());
}

const std::string kView =
    "moving.glb -q --size 24x16 --integrator pt --combine none --look-at 0.5,0.5,3,0.5,0.5,0 --reproducible ";
const std::string kOptions = kView + "--spp 4 ";

void must(const Folder& folder, const std::string& arguments) {
  const Run run = braidRun(folder, arguments);
  INFO(arguments);
  INFO(run.err);
  REQUIRE(run.code == 0);
}

std::string bytes(const Folder& folder, const std::string& file) {
  REQUIRE(std::filesystem::exists(folder.path / file));
  return readText(folder.path / file);
}

}  // namespace

TEST_CASE("Frames equal those that are rendered alone, to the byte") {
  const Folder folder;
  movingScene(folder);
  must(folder, "render " + kOptions + "-o out_##.exr --png p%03d.png --frames 2:9:3 --fps 10");
  for (const auto& [frame, time] : {std::pair<std::string, std::string>("02", "0.2"), {"05", "0.5"}, {"08", "0.8"}}) {
    must(folder, "render " + kOptions + "-o alone.exr --png alone.png --frame-time " + time);
    CHECK(bytes(folder, "out_" + frame + ".exr") == bytes(folder, "alone.exr"));
    CHECK(bytes(folder, "p0" + frame + ".png") == bytes(folder, "alone.png"));
  }
  CHECK(bytes(folder, "out_02.exr") != bytes(folder, "out_08.exr"));
  for (const auto& entry : std::filesystem::directory_iterator(folder.path))
    CHECK_FALSE(contains(entry.path().filename().string(), ".part."));
}

TEST_CASE("What is finished is left, what is missing is rendered, and --overwrite renders all") {
  const Folder folder;
  movingScene(folder);
  const std::string command = "render " + kOptions + "-o out_#.exr --frames 0:3 --fps 2 ";
  must(folder, command);
  const std::string first = bytes(folder, "out_0.exr"), second = bytes(folder, "out_1.exr");
  std::filesystem::remove(folder.path / "out_1.exr");
  folder.write("out_0.exr", "mine");
  must(folder, command + "--log-json log");
  CHECK(bytes(folder, "out_0.exr") == "mine");
  CHECK(bytes(folder, "out_1.exr") == second);
  const std::string log = bytes(folder, "log");
  CHECK(contains(log, R"("event":"frame","finished":true,"frame":0)"));
  CHECK(contains(log, R"("event":"frame","finished":false,"frame":1)"));
  must(folder, command + "--overwrite");
  CHECK(bytes(folder, "out_0.exr") == first);
}

TEST_CASE("An unfinished frame goes on from its checkpoint, without being told") {
  const Folder folder;
  movingScene(folder);
  const std::string frames = " --frames 0:3 --fps 2 ";
  must(folder, "render " + kOptions + "-o whole_#.exr" + frames);
  // As an interruption leaves them: frame 0 finished, frame 1 with half of its passes.
  must(folder, "render " + kOptions + "-o out_#.exr --checkpoint s_#.state --frames 0:1 --fps 2");
  must(folder, "render " + kView + "--passes 0:2 --checkpoint s_1.state --frame-time 0.5");
  REQUIRE(readStateHeader(folder.path / "s_1.state").rounds() == 2);
  must(folder, "render " + kOptions + "-o out_#.exr --checkpoint s_#.state" + frames);
  CHECK(readStateHeader(folder.path / "s_1.state").rounds() == 4);
  for (const char* n : {"0", "1", "2"})
    CHECK(bytes(folder, std::string("out_") + n + ".exr") == bytes(folder, std::string("whole_") + n + ".exr"));
  // Shares without images: their states say that they are finished.
  const std::string share = "render " + kOptions + "--checkpoint s_#.state --log-json log" + frames;
  must(folder, share);
  CHECK_FALSE(contains(bytes(folder, "log"), R"("finished":false)"));
}

TEST_CASE("Frames that are killed are gone on from, and equal those of a run that was not") {
  const Folder folder;
  const std::string scene = movingScene(folder);
  const auto named = [&](const char* stem, const std::string& number, const char* ending) {
    return fmt::format("{}/{}_{}{}", folder.path.string(), stem, number, ending);
  };
  const auto start = [&](const char* stem, std::vector<std::string> more) {
    more.insert(more.end(),
                {"--size", "48x32", "--spp", "256", "--threads", "2", "--reproducible", "--look-at",
                 "0.5,0.5,3,0.5,0.5,0", "--frames", "0:24", "--fps", "24", "-o", named(stem, "##", ".exr")});
    return std::make_unique<test::Process>(more, "render", "", scene);
  };
  const auto startAgain = [&](const std::string& log) {
    return start("out", {"--checkpoint", named("s", "##", ".state"), "--save-every", "0.02", "--log-json", log});
  };
  CHECK(start("whole", {})->wait() == 0);
  int finished = 0, resumed = 0;
  uint64_t kept = 0;  // passes of the frame that comes next
  for (const auto& [frame, signal] : {std::pair(3, SIGKILL), {8, SIGTERM}, {14, SIGKILL}, {20, SIGTERM}, {24, 0}}) {
    const std::string number = fmt::format("{:02}", frame), log = named("log", number, ""),
                      state = named("s", number, ".state");
    const auto process = startAgain(log);
    if (signal != 0) {
      REQUIRE(test::waitUntil([&] { return std::filesystem::exists(state); }));
      process->signal(signal);
    }
    CHECK(process->wait() == (signal == SIGKILL ? -SIGKILL : signal == SIGTERM ? 130 : 0));
    for (const test::Json& r : test::records(log, "frame")) CHECK(r["finished"] == (r["frame"] < finished));
    // The first round of the frame that was cut off, unless it was finished just before.
    if (kept > 0 && kept < 256) resumed += test::records(log, "progress").at(0)["spp"] > kept;
    finished = frame + (signal != 0 && std::filesystem::exists(named("out", number, ".exr")));
    kept = signal != 0 ? readStateHeader(state).rounds() : 0;
  }
  CHECK(resumed > 0);
  for (int i = 0; i < 24; ++i) {
    const std::string number = fmt::format("{:02}", i);
    CHECK(readText(named("out", number, ".exr")) == readText(named("whole", number, ".exr")));
    CHECK_FALSE(std::filesystem::exists(named("out", number, ".part.exr")));
  }
}

TEST_CASE("An interruption ends all frames and leaves no image under a finished one's name") {
  const Folder folder;
  movingScene(folder);
  const Run run =
      braidRun(folder, "render " + kView + "--spp 100000000 -o out_#.exr --checkpoint s_#.state --frames 0:3",
               "timeout -s TERM 2 ");
  CHECK((run.code == 130 || run.code == 124));
  CHECK_FALSE(std::filesystem::exists(folder.path / "out_0.exr"));
  CHECK(std::filesystem::exists(folder.path / "out_0.part.exr"));
  CHECK(std::filesystem::exists(folder.path / "s_0.state"));
  CHECK_FALSE(std::filesystem::exists(folder.path / "s_1.state"));
}

TEST_CASE("A turntable turns a still scene, and begins where the camera stands") {
  const Folder folder;
  movingScene(folder);
  must(folder, "render " + kOptions + "-o turn_#.exr --turntable 4");
  must(folder, "render " + kOptions + "-o still.exr");
  CHECK(readImage(folder.path / "turn_0.exr").planes.at("R").data ==
        readImage(folder.path / "still.exr").planes.at("R").data);
  must(folder, "render " + kOptions + "-o alone.exr --turntable 4 --frames 3:4");
  CHECK(bytes(folder, "turn_3.exr") == bytes(folder, "alone.exr"));
  CHECK(bytes(folder, "turn_1.exr") != bytes(folder, "turn_0.exr"));
  must(folder, "render " + kOptions + "-o play_#.exr --turntable 4 --frames 0:2 --fps 2");
  CHECK(bytes(folder, "turn_0.exr") != "");
}

TEST_CASE("A turntable of a file without a camera cuts nothing off, in any turn") {
  const Folder folder;
  movingScene(folder);  // a square, which comes nearer to the camera than the middle does when it turns
  must(folder,
       "render moving.glb -q --size 32x32 --integrator pt --combine none --spp 4 --transparent --turntable 8 "
       "-o turn_#.exr");
  for (int frame = 0; frame < 8; ++frame) {
    const Plane<float> alpha = readImage(folder.path / fmt::format("turn_{}.exr", frame)).planes.at("A");
    CAPTURE(frame);
    float most = 0;
    for (int i = 0; i < 32; ++i) {
      CHECK(alpha.at(i, 0) + alpha.at(i, 31) + alpha.at(0, i) + alpha.at(31, i) == 0);
      most = std::max(most, alpha.at(i, 16));
    }
    CHECK((most > 0 || (frame >= 2 && frame <= 6)));  // on edge, and from behind
  }
}

TEST_CASE("Frames that cannot be are refused in one line") {
  const Folder folder;
  movingScene(folder);
  folder.write("still.glb", test::quadFile().glb());
  const auto refusal = [&](const std::string& arguments) {
    const Run run = braidRun(folder, "render " + arguments);
    CHECK(run.code == 1);
    CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 1);
    return run.err;
  };
  CHECK(contains(refusal(kOptions + "-o out.exr --frames 0:3"), "out_####.exr"));
  CHECK(contains(refusal(kOptions + "-o out_#.exr --png p.png --frames 0:3"), "--png p.png"));
  CHECK(contains(refusal(kOptions + "-o out_#.exr --frames 3:3"), "FIRST:END"));
  CHECK(contains(refusal(kOptions + "-o out_#.exr --frames 0:3 --frame-time 1"), "--frame-time"));
  CHECK(contains(refusal(kOptions + "-o out_#.exr --fps 24"), "--frames"));
  CHECK(contains(refusal(kOptions + "-o out_#.exr --fps 0 --frames 0:3"), "--fps"));
  std::string still = kOptions;
  still.replace(0, 10, "still.glb");
  CHECK(contains(refusal(still + "-o out_#.exr --frames 0:3"), "no animation"));
}

TEST_CASE("A job of frames for make renders, merges, and goes on after failures") {
  const Folder folder;
  movingScene(folder);
  // Fails twice: at a share, and at a merge.
  folder.write("flaky",
               "#!/bin/sh\ncase \"$*\" in\n"
               "*--frames=1:2*) [ -e failed1 ] || { touch failed1; exit 9; } ;;\n"
               "*merge*--frame=2*) [ -e failed2 ] || { touch failed2; exit 9; } ;;\nesac\nexec '" BRAID_BINARY
               "' \"$@\"\n");
  std::filesystem::permissions(folder.path / "flaky", std::filesystem::perms::owner_all);
  const Run plan =
      braidRun(folder, "plan " + kOptions +
                           "-o out_##.exr --frames 0:3 --fps 2 --tasks 2 --threads 1 --aovs all --format make "
                           "--program '" +
                           (folder.path / "flaky").string() + "'");
  INFO(plan.err);
  REQUIRE(plan.code == 0);
  folder.write("job.mk", plan.out);
  const std::string make = "cd '" + folder.path.string() + "' && make -k -j2 -f job.mk >log 2>&1";
  CHECK(std::system(make.c_str()) != 0);
  CHECK(std::filesystem::exists(folder.path / "out_00.exr"));
  CHECK_FALSE(std::filesystem::exists(folder.path / "out_01.exr"));
  CHECK_FALSE(std::filesystem::exists(folder.path / "out_02.exr"));
  CHECK(std::system(make.c_str()) == 0);
  must(folder, "render " + kOptions + "-o whole_##.exr --frames 0:3 --fps 2 --aovs all");
  for (const char* n : {"00", "01", "02"}) {
    const ImageFile a = readImage(folder.path / (std::string("out_") + n + ".exr")),
                    b = readImage(folder.path / (std::string("whole_") + n + ".exr"));
    CHECK(a.planes.at("pt.mean.R").data == b.planes.at("pt.mean.R").data);
  }
}

}  // namespace braid::test_frames_cli
