// SPDX-License-Identifier: Apache-2.0
// `--shutter` on the command line: what it refuses, what the plan says, and that resumed and merged renders are those
// of one run.
#include <cstring>

#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "tests/support/command_line.h"

namespace braid::test_shutter_cli {

using test::braidRun;
using test::contains;
using test::Folder;
using test::readText;
using test::Run;

namespace {

// A square that moves for a second and rests for another.
void movingScene(const Folder& folder) {
  test::GltfFile file = test::quadFile();
  const int times = file.accessor<float>({0, 1, 2}, "SCALAR");
  const int moves = file.accessor<float>({0, 0, 0, 1, 0.5, 0, 1, 0.5, 0}, "VEC3");
  file.append("animations", {{"name", "move"},
                             {"samplers", {{{"input", times}, {"output", moves}}}},
                             {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}});
  folder.write("moving.glb", file.glb());
}

const std::string kView =
    "moving.glb -q --size 24x16 --combine none --look-at 0.5,0.5,3,0.5,0.5,0 --reproducible --integrator ";

Run must(const Folder& folder, const std::string& arguments) {
  const Run run = braidRun(folder, arguments);
  INFO(arguments);
  INFO(run.err);
  REQUIRE(run.code == 0);
  return run;
}

// Whether two images are the same to the bit, whatever their headers say.
bool samePixels(const Folder& folder, const std::string& a, const std::string& b) {
  const ImageFile first = readImage(folder.path / a), second = readImage(folder.path / b);
  if (first.channelNames != second.channelNames) return false;
  for (const std::string& name : first.channelNames) {
    const Plane<float>&p = first.planes.at(name), &q = second.planes.at(name);
    if (p.size() != q.size() || std::memcmp(p.data.data(), q.data.data(), p.size() * sizeof(float)) != 0) return false;
  }
  return true;
}

std::string bytes(const Folder& folder, const std::string& file) { return readText(folder.path / file); }

}  // namespace

TEST_CASE("--shutter: what is no length of time, and what has no time, is refused") {
  const Folder folder;
  movingScene(folder);
  const auto code = [&](const std::string& options) {
    return braidRun(folder, "render " + kView + "pt --spp 1 -o o.exr " + options).code;
  };
  CHECK(code("--frame-time 0 --shutter -1") == 1);
  CHECK(code("--frame-time 0 --shutter nan") == 1);
  CHECK(code("--frame-time 0 --shutter inf") == 1);
  CHECK(code("--frame-time 0 --shutter wide") == 1);
  CHECK(code("--shutter 0.5") == 1);
  CHECK(code("--shutter 0") == 0);
  CHECK(code("--frame-time 0 --shutter 1e9") == 0);
  const Run run = braidRun(folder, "render " + kView + "pt -o o.exr --shutter 0.5");
  CHECK(contains(run.err, "--frame-time"));
}

TEST_CASE("--shutter: the plan says what blurs, and where it is left out the picture is the still one, to the bit") {
  const Folder folder;
  movingScene(folder);
  const auto plan = [&](const std::string& options) {
    return must(folder, "plan moving.glb --look-at 0.5,0.5,3,0.5,0.5,0 --integrator pt,sppm " + options).out;
  };
  CHECK(contains(plan("--frame-time 0.5 --shutter 0.25"), "+ motion blur: the shutter is open for 0.25 s"));
  CHECK(contains(plan("--frame-time 0.5 --shutter 0.25"), "+ sppm instants"));
  CHECK(contains(plan("--frame-time 1.25 --shutter 0.5"), "- motion blur: nothing moves"));
  CHECK_FALSE(contains(plan("--frame-time 0.5"), "motion blur"));
  for (const std::string name : {"pt", "bdpt", "sppm"}) {
    must(folder, "render " + kView + name + " --spp 4 --float --frame-time 1.25 --shutter 0.5 -o a.exr");
    must(folder, "render " + kView + name + " --spp 4 --float --frame-time 1.25 -o b.exr");
    CHECK(samePixels(folder, "a.exr", "b.exr"));
    must(folder, "render " + kView + name + " --spp 4 --float --frame-time 0.25 --shutter 0.5 -o c.exr");
    CHECK_FALSE(samePixels(folder, "b.exr", "c.exr"));
  }
}

TEST_CASE("--shutter: frames, resumed and merged renders are those of one run; another shutter is another picture") {
  const Folder folder;
  movingScene(folder);
  for (const std::string name : {"pt", "vcm"}) {
    const std::string view = "render " + kView + name + " --shutter 0.4 ";
    must(folder, view + "--frame-time 0.5 --spp 8 -o whole.exr");
    must(folder, view + "--frames 5:6 --fps 10 --spp 8 -o f_#.exr --overwrite");
    CHECK(bytes(folder, "whole.exr") == bytes(folder, "f_5.exr"));
    must(folder, view + "--frame-time 0.5 --spp 4 --checkpoint s.state --overwrite -o part.exr");
    must(folder, view + "--frame-time 0.5 --spp 8 --resume s.state -o resumed.exr");
    CHECK(bytes(folder, "whole.exr") == bytes(folder, "resumed.exr"));
    must(folder, view + "--frame-time 0.5 --passes 0:4 --checkpoint a.state --overwrite");
    must(folder, view + "--frame-time 0.5 --passes 4:8 --checkpoint b.state --overwrite");
    must(folder, "merge a.state b.state -o merged.exr -q");
    must(folder, "compare merged.exr whole.exr --metric relL2 --max 1e-9");
    must(folder,
         "render " + kView + name + " --shutter 0.3 --frame-time 0.5 --passes 4:8 --checkpoint c.state --overwrite");
    const Run refused = braidRun(folder, "merge a.state c.state -o no.exr");
    CHECK(refused.code != 0);
    CHECK(contains(refused.err, "--shutter"));
  }
}

}  // namespace braid::test_shutter_cli
