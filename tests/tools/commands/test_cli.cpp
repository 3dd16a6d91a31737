// SPDX-License-Identifier: Apache-2.0
// The command line as its users see it: exit codes, messages, limits, logs and lists of the real binary.
#include <chrono>
#include <csignal>
#include <thread>

#include <doctest/doctest.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "renderer/film/files/exr.h"
#include "tests/support/command_line.h"
#include "tests/support/gltf_fixture.h"
#include "tests/tools/commands/cli_renders.h"

namespace braid::test_cli {

namespace fs = std::filesystem;
using namespace test::cli_renders;
using test::braidRun;
using test::contains;
using test::Folder;
using test::Json;
using test::readText;
using test::Run;

namespace {

size_t lines(const std::string& text) { return static_cast<size_t>(std::count(text.begin(), text.end(), '\n')); }

std::vector<Json> records(const fs::path& log) {
  std::ifstream in(log);
  std::vector<Json> list;
  std::string line;
  while (std::getline(in, line)) list.push_back(Json::parse(line));
  return list;
}

}  // namespace

TEST_CASE("Wrong usage is exit code 1 and names what is known") {
  const Folder folder;
  CHECK(braidRun(folder, renderCommand("--sp 3")).code == 1);
  CHECK(braidRun(folder, "").code == 1);
  CHECK(braidRun(folder, "nonsense").code == 1);
  const auto refused = [&](const std::string& option, const std::string& known) {
    const Run run = braidRun(folder, renderCommand(option));
    INFO(option, ": ", run.err);
    CHECK(run.code == 1);
    CHECK(lines(run.err) == 1);
    CHECK(contains(run.err, known));
    CHECK_FALSE(fs::exists(folder.path / "out.exr"));
  };
  refused("--integrator pf", "known are auto, pt");
  refused("--camera nobody", "it has 0 '");
  refused("--sampler dice", "sobol, independent");
  refused("--filter sharp", "box, gaussian, blackman-harris");
  refused("--aovs some", "none, features, all");
  refused("--time soon", "1h30m");
  refused("--size 0x5", "WIDTHxHEIGHT");
  refused("--crop 1,2,3", "4 numbers");
  refused("--crop 0,0,99,99", "24x16");
}

TEST_CASE("A broken scene is exit code 2, with every problem on a line of its own") {
  const Folder folder;
  Run run = braidRun(folder, renderCommand("", "none.glb"));
  CHECK(run.code == 2);
  CHECK(contains(run.err, "none.glb"));
  test::GltfFile file = test::triangleFile();
  file.primitive()["indices"] = 99;
  file.primitive()["material"] = 5;
  folder.write("broken.glb", file.glb());
  run = braidRun(folder, renderCommand("", "broken.glb"));
  INFO(run.err);
  CHECK(run.code == 2);
  CHECK(contains(run.err, "broken.glb: /meshes/0/primitives/0/indices: "));
  CHECK(contains(run.err, "broken.glb: /meshes/0/primitives/0/material: "));
  folder.write("text.glb", "no glTF at all");
  CHECK(braidRun(folder, renderCommand("", "text.glb")).code == 2);
  CHECK(braidRun(folder, "info text.glb").code == 2);
  CHECK(braidRun(folder, "compare text.glb text.glb").code == 2);
  CHECK(braidRun(folder, renderCommand("--env none.hdr")).code == 2);
}

TEST_CASE("A required extension that is not known is exit code 4") {
  const Folder folder;
  test::GltfFile file = test::triangleFile();
  file.root["extensionsUsed"] = file.root["extensionsRequired"] = {"EXT_unheard_of"};
  folder.write("future.glb", file.glb());
  const Run run = braidRun(folder, renderCommand("", "future.glb"));
  CHECK(run.code == 4);
  CHECK(contains(run.err, "EXT_unheard_of"));
  CHECK(braidRun(folder, renderCommand("--ignore-extension EXT_unheard_of", "future.glb")).code == 0);
}

TEST_CASE("A flaw costs a warning, which header, log and info count; with --strict the render") {
  const Folder folder;
  test::GltfFile file = test::triangleFile();
  file.primitive()["material"] = 5;
  file.root["materials"] = {{{"alphaMode", "CUTOUT"}}};
  folder.write("flawed.glb", file.glb());
  const ImageFile image = rendered(folder, "--log-json log.json", "flawed.glb");
  const Json info = Json::parse(braidRun(folder, "info flawed.glb --json").out);
  REQUIRE(!info["warnings"].empty());
  CHECK(contains(info["warnings"][0].get<std::string>(), "/meshes/0/primitives/0/material: is 5"));
  REQUIRE(info["notes"].size() == 1);
  CHECK(contains(info["notes"][0].get<std::string>(), "/materials/0/alphaMode: is 'CUTOUT'"));
  REQUIRE(attribute(image, "braid/warnings"));
  CHECK(attribute(image, "braid/warnings")->integer == static_cast<int64_t>(info["warnings"].size()));
  CHECK(records(folder.path / "log.json").back()["warnings"] == info["warnings"]);
  const Run strict = braidRun(folder, renderCommand("--strict", "flawed.glb"));
  CHECK(strict.code == 2);
  CHECK(contains(strict.err, "flawed.glb: /materials/0/alphaMode"));
  CHECK(contains(strict.err, "flawed.glb: /meshes/0/primitives/0/material"));
}

TEST_CASE("An output that cannot be written is exit code 3 and leaves the previous file alone") {
  const Folder folder;
  Run run = braidRun(folder, renderCommand("-o nowhere/out.exr"));
  INFO(run.err);
  CHECK(run.code == 3);
  CHECK(lines(run.err) == 1);
  CHECK(contains(run.err, "nowhere"));
  CHECK(braidRun(folder, renderCommand("--png nowhere/a.png")).code == 3);
  CHECK(braidRun(folder, renderCommand("--log-json nowhere/log")).code == 3);
  fs::create_directory(folder.path / "folder.exr");
  CHECK(braidRun(folder, renderCommand("-o folder.exr")).code == 3);

  // A file may grow to 4 KiB only: as if the disk were full.
  folder.write("out.exr", "the previous image");
  run = braidRun(folder, renderCommand("--size 64x64"), "trap '' XFSZ; ulimit -f 8; ");
  INFO(run.err);
  CHECK(run.code == 3);
  CHECK(contains(run.err, "out.exr"));
  CHECK(readText(folder.path / "out.exr") == "the previous image");
  for (const fs::directory_entry& entry : fs::directory_iterator(folder.path))
    CHECK_FALSE(contains(entry.path().filename(), ".tmp-"));
}

TEST_CASE("An interrupt saves the image and is exit code 130") {
  const Folder folder;
  const std::string output = folder.path / "out.exr", log = folder.path / "log";
  const std::string scene = BRAID_SOURCE_DIR "/scenes/cornell.glb";
  const std::vector<std::string> words{BRAID_BINARY, "render",    scene, "-q",   "--size",     "64x64",
                                       "--spp",      "100000000", "-o",  output, "--log-json", log};
  std::vector<char*> arguments;
  for (const std::string& w : words) arguments.push_back(const_cast<char*>(w.c_str()));
  arguments.push_back(nullptr);
  pid_t child = 0;
  REQUIRE(posix_spawn(&child, BRAID_BINARY, nullptr, nullptr, arguments.data(), environ) == 0);
  for (int i = 0; i < 3000 && !contains(readText(log), "\"progress\""); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  REQUIRE(kill(child, SIGINT) == 0);
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  REQUIRE(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 130);
  const ImageFile image = readImage(output);
  CHECK(image.width == 64);
  const std::vector<Json> all = records(log);
  CHECK(all.back()["event"] == "end");
  CHECK(all.back()["status"] == "interrupted");
  REQUIRE(attribute(image, "samplesPerPixel"));
  CHECK(attribute(image, "samplesPerPixel")->integer == all.back()["spp"].get<int64_t>());
}

TEST_CASE("A time limit ends the render") {
  const Folder folder;
  const auto start = std::chrono::steady_clock::now();
  const Run run = braidRun(folder, "render " + kCornell + " --size 32x32 --time 0.3s -o out.exr --log-json log");
  CHECK(run.code == 0);
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(20));
  CHECK(contains(run.err, "stopped by time"));
  CHECK(contains(run.err, "Saved: out.exr"));
  CHECK(records(folder.path / "log").back()["reason"] == "time");
}

TEST_CASE("The JSON log has a plan, progress and an end") {
  const Folder folder;
  rendered(folder, "--log-json log");
  const std::vector<Json> all = records(folder.path / "log");
  REQUIRE(all.size() == 4);
  for (const Json& record : all) CHECK(record["schema"] == 1);
  CHECK(all[0]["event"] == "plan");
  CHECK(contains(all[0]["text"], "pt"));
  CHECK(all[1]["event"] == "progress");
  CHECK(all[2]["spp"] == 2);
  const Json& end = all[3];
  CHECK(end["event"] == "end");
  CHECK(end["status"] == "done");
  CHECK(end["spp"] == 2);
  CHECK(end["outputs"] == Json::array({"out.exr"}));
  CHECK(end["paths"] == 24 * 16 * 2);
  CHECK(end["rejectedSamples"] == 0);
}

TEST_CASE("plan, info and the lists tell what there is") {
  const Folder folder;
  const Run plan = braidRun(folder, "plan " + kCornell + " --json");
  REQUIRE(plan.code == 0);
  const Json p = Json::parse(plan.out);
  CHECK(p["schema"] == 1);
  CHECK(p["hash"].get<std::string>().size() == 16);
  CHECK(p["plan"][0]["subject"] == "pt");
  CHECK(p["memoryBytes"]["geometry"].get<int>() > 0);
  const Run text = braidRun(folder, "plan " + kCornell);
  CHECK(contains(text.out, "+ pt: "));
  CHECK(contains(text.out, "- texture lookups: no material reads a texture"));

  const Run info = braidRun(folder, "info " + kCornell + " --json");
  REQUIRE(info.code == 0);
  const Json i = Json::parse(info.out);
  CHECK(i["schema"] == 1);
  CHECK(i["triangles"].get<int>() > 10);
  CHECK(i["emissiveTriangles"].get<int>() >= 2);
  CHECK(i["cameras"].size() == 1);
  CHECK(i["bounds"]["min"].size() == 3);
  CHECK(contains(braidRun(folder, "info " + kCornell).out, "triangles"));

  const Run list = braidRun(folder, "--list");
  CHECK(list.code == 0);
  for (const char* word : {"integrators", "pt ", "metrics", "relMSE", "FLIP"})
    CHECK_MESSAGE(contains(list.out, word), word);
  for (const char* beside : {"sweep --list", "bench --list", "render --list"})
    CHECK(braidRun(folder, beside).out == list.out);
  CHECK(braidRun(folder, "--version").code == 0);
  for (const char* command : {"", "render", "plan", "info", "compare", "replay", "bench"})
    CHECK(braidRun(folder, std::string(command) + " --help").code == 0);
}

TEST_CASE("info tells what images and states hold, and what other files are") {
  const Folder folder;
  REQUIRE(braidRun(folder, renderCommand("--spp 4 --crop 4,2,20,14 --checkpoint run.state")).code == 0);
  const auto record = [&](const std::string& file) {
    const Run run = braidRun(folder, "info --json " + file);
    INFO(run.err);
    REQUIRE(run.code == 0);
    return Json::parse(run.out);
  };
  const Json image = record("out.exr");
  CHECK(image["kind"] == "image");
  CHECK(image["window"] == Json{4, 2, 20, 14});
  CHECK(image["layers"][""] == Json{"R", "G", "B"});
  CHECK(image["layers"].contains("Albedo"));
  CHECK(image["attributes"]["samplesPerPixel"] == 4);
  const Json state = record("run.state");
  CHECK(state["kind"] == "state");
  CHECK(state["size"] == image["size"]);
  CHECK(state["passes"]["pt"] == Json{{0, 4}});
  CHECK(state["options"]["--crop"] == "4,2,20,14");
  CHECK(contains(braidRun(folder, "info out.exr").out, "  braid/seed: 0\n"));
  CHECK(contains(braidRun(folder, "info run.state").out, "  passes      pt [[0,4]]\n"));

  std::ofstream(folder.path / "cut.exr") << "\x76\x2F\x31\x01";
  std::ofstream(folder.path / "cut.state") << "braid-state 3 100";
  std::ofstream(folder.path / "model.fbx") << "Kaydara FBX Binary";
  REQUIRE(mkfifo((folder.path / "pipe.exr").c_str(), 0600) == 0);
  for (const char* file : {"cut.exr", "cut.state", "model.fbx", "pipe.exr"}) {
    const Run run = braidRun(folder, std::string("info ") + file);
    CHECK(run.code == 2);
    CHECK(lines(run.err) == 1);
    CHECK(contains(run.err, file));
  }
}

TEST_CASE("Animations are listed with their lengths, and chosen by name or index") {
  const Folder folder;
  test::GltfFile file = test::triangleFile();
  const int times = file.accessor<float>({0, 0.5f, 2.25f}, "SCALAR");
  const int moves = file.accessor<float>({0, 0, 0, 1, 0, 0, 2, 0, 0}, "VEC3");
  for (const char* name : {"walk", "jump"})
    file.root["animations"].push_back(
        {{"name", name},
         {"samplers", {{{"input", times}, {"output", moves}}}},
         {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}});
  folder.write("clips.glb", file.glb());
  const Run info = braidRun(folder, "info clips.glb --json");
  REQUIRE(info.code == 0);
  const Json list = Json::parse(info.out)["animations"];
  REQUIRE(list.size() == 2);
  CHECK(list[1]["name"] == "jump");
  CHECK(list[0]["seconds"] == 2.25);
  CHECK(contains(braidRun(folder, "info clips.glb").out, "1 'jump', 2.25 s"));
  const auto lowest = [&](const std::string& options) {
    return Json::parse(braidRun(folder, "info clips.glb --json " + options).out)["bounds"]["min"][0].get<double>();
  };
  CHECK(lowest("--frame-time 0.5") == 1);
  CHECK(lowest("--frame-time 2.25 --animation jump") == 2);
  CHECK(lowest("--frame-time 2.25 --animation 1") == 2);
  const Run unknown = braidRun(folder, "plan clips.glb --animation run");
  CHECK(unknown.code == 1);
  CHECK(contains(unknown.err, "the file has 0 'walk', 1 'jump'"));
}

}  // namespace braid::test_cli
