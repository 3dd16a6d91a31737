// SPDX-License-Identifier: Apache-2.0
// What render, preview and plan do when nothing is said: the integrators that the scene needs, combined, in a file of
// the image, its error and features. Where the default cannot run it is left out without a warning.
#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "renderer/film/files/state_file.h"
#include "tests/support/command_line.h"

namespace braid::test_defaults {

using test::braidRun;
using test::contains;
using test::Folder;
using test::Json;
using test::Run;
namespace fs = std::filesystem;

namespace {

const std::string kScene = "'" BRAID_SOURCE_DIR "/scenes/cornell.glb' ";
const std::string kSmall = "--size 32x24 --reproducible ";

Run must(const Folder& folder, const std::string& command) {
  const Run run = braidRun(folder, command);
  INFO(command, "\n", run.err);
  REQUIRE(run.code == 0);
  CHECK_FALSE(contains(run.err, "warning"));
  return run;
}

// The channels with 'h' for half floats, 'f' for floats.
std::map<std::string, char> formatsOf(const fs::path& path) {
  const auto in = OIIO::ImageInput::open(path.string());
  REQUIRE(in);
  std::map<std::string, char> formats;
  for (int c = 0; c < in->spec().nchannels; ++c)
    formats[in->spec().channel_name(c)] = in->spec().channelformat(c) == OIIO::TypeDesc::HALF ? 'h' : 'f';
  return formats;
}

std::string headlineOf(const ImageFile& file) {
  for (const Attribute& a : file.attributes)
    if (a.name == "braid/headline") return a.text;
  return "";
}

bool equal(const Rgb<float>& a, const Rgb<float>& b) {
  return a[0].data == b[0].data && a[1].data == b[1].data && a[2].data == b[2].data;
}

}  // namespace

TEST_CASE("A render of which nothing is said is combined, and its file holds the image, its error and features") {
  const Folder folder;
  must(folder, "render " + kScene + kSmall + "--spp 8 -o out.exr --png out.png");
  const ImageFile file = readImage(folder.path / "out.exr");
  CHECK(headlineOf(file) == "combined.auto");
  CHECK(formatsOf(folder.path / "out.exr") == std::map<std::string, char>{{"R", 'h'},
                                                                          {"G", 'h'},
                                                                          {"B", 'h'},
                                                                          {"Albedo.R", 'h'},
                                                                          {"Albedo.G", 'h'},
                                                                          {"Albedo.B", 'h'},
                                                                          {"N.X", 'h'},
                                                                          {"N.Y", 'h'},
                                                                          {"N.Z", 'h'},
                                                                          {"Depth.Z", 'f'},
                                                                          {"Visibility.V", 'h'},
                                                                          {"Error.Y", 'f'}});
  must(folder, "render " + kScene + kSmall + "--spp 8 -o all.exr --aovs all --float");
  const ImageFile all = readImage(folder.path / "all.exr");
  CHECK(equal(all.rgb(), all.rgb("combined.auto")));
  for (const auto& [name, format] : formatsOf(folder.path / "all.exr")) CHECK_MESSAGE(format == 'f', name);
  for (const char* layer : {"pt.mean", "pt.halfA", "pt.variance", "AlbedoVariance", "Error"})
    CHECK_MESSAGE(hasLayer(all, layer), layer);
  CHECK(file.planes.at("Error.Y").data == all.planes.at("Error.Y").data);
  CHECK(file.planes.at("Depth.Z").data == all.planes.at("Depth.Z").data);
  for (size_t i = 0; i < file.planes.at("R").size(); ++i)
    CHECK(file.planes.at("R")[i] == doctest::Approx(all.planes.at("R")[i]).epsilon(1e-3));
  // One word away.
  must(folder, "render " + kScene + kSmall + "--spp 8 -o plain.exr --integrator pt --combine none --float");
  const ImageFile plain = readImage(folder.path / "plain.exr");
  CHECK(headlineOf(plain).empty());
  CHECK(equal(plain.rgb(), all.rgb("pt.mean")));
  CHECK(plain.planes.count("Error.Y") == 1);
  // Layers that are asked for are written.
  for (const char* option : {"--quarters", "--direct-indirect", "--history", "--denoiser box", "--weights"}) {
    must(folder, "render " + kScene + kSmall + "--spp 8 -o more.exr " + option);
    CHECK_MESSAGE(hasLayer(readImage(folder.path / "more.exr"), "pt.halfB"), option);
  }
}

TEST_CASE("combine names what a default file does not hold, and the option") {
  const Folder folder;
  must(folder, "render " + kScene + kSmall + "--spp 8 -o out.exr");
  const Run run = braidRun(folder, "combine --unbiased out.exr --method nfor -o c.exr");
  CHECK(run.code == 2);
  CHECK(contains(run.err, "out.exr: holds the image that combined.auto made, and not the estimates"));
  CHECK(contains(run.err, "--aovs all"));
  must(folder, "render " + kScene + kSmall + "--spp 8 -o all.exr --aovs all");
  must(folder, "combine --unbiased all.exr --bases all.exr,out.exr --method average -o c.exr");
  must(folder, "render " + kScene + kSmall + "--spp 8 -o plain.exr --combine none");
  CHECK(contains(braidRun(folder, "combine --unbiased plain.exr --method box -o c.exr").err, "--aovs all"));
}

TEST_CASE("Where the default cannot combine, the image stays as it is, without a warning") {
  const Folder folder;
  const std::string note = "note: nothing is combined: auto: needs ";
  for (const char* rest : {"--spp 8 --integrator crn", "--spp 8 --integrator crn,gdpt"}) {
    const Run run = must(folder, "render " + kScene + kSmall + "-o out.exr " + rest);
    CHECK_MESSAGE(contains(run.err, note), rest);
    CHECK(headlineOf(readImage(folder.path / "out.exr")).empty());
    CHECK_FALSE(contains(must(folder, "render " + kScene + kSmall + "-q -o out.exr " + rest).err, "note"));
  }
  CHECK(braidRun(folder, "render " + kScene + kSmall + "-o out.exr --spp 8 --integrator crn --combine auto").code == 1);
  must(folder, "render " + kScene + kSmall + "-o out.exr --spp 1");
  CHECK(headlineOf(readImage(folder.path / "out.exr")) == "combined.auto");
  for (const char* size : {"1x1", "1x7", "2x2"}) must(folder, "render " + kScene + "--spp 8 -o out.exr --size " + size);
  must(folder, "render " + kScene + kSmall + "--spp 8 -o out.exr --quarters --transparent");
  // Less memory than combining takes: the default gives way, what is asked for is refused.
  const std::string view = kScene + "--size 800x600 --spp 2 ";
  const auto total = [&](const std::string& combine) {
    return Json::parse(must(folder, "plan --json " + view + combine).out)["memoryBytes"]["total"].get<uint64_t>() >> 20;
  };
  const std::string limit =
      " --memory-limit " + std::to_string((total("--no-helpers") + total("--combine none")) / 2) + "M";
  CHECK(contains(must(folder, "render " + view + "-o out.exr" + limit).err,
                 "nothing is combined: auto: takes more memory"));
  CHECK(braidRun(folder, "render " + view + "-o out.exr --combine auto" + limit).code == 5);
}

TEST_CASE("Shares and checkpoints keep what combining their sum will take") {
  const Folder folder;
  const std::string render = "render " + kScene + kSmall;
  must(folder, render + "--passes 0:1 --checkpoint a.state -o share.exr");
  must(folder, render + "--passes 1:3 --checkpoint b.state");
  must(folder, render + "--passes 3:8 --checkpoint c.state");
  CHECK(readStateHeader(folder.path / "a.state").buckets == 4);
  must(folder, "merge a.state b.state c.state --reproducible --combine auto --float -o merged.exr");
  must(folder, render + "--spp 8 --float --aovs all -o whole.exr");
  const Rgb<float> merged = readImage(folder.path / "merged.exr").rgb(),
                   whole = readImage(folder.path / "whole.exr").rgb();
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < whole.size(); ++i)
      CHECK(std::fabs(merged[c][i] - whole[c][i]) <= 1e-3f * std::max(1.0f, std::fabs(whole[c][i])));
  // A checkpoint alone, then an image of it; and a state without what the default takes.
  must(folder, render + "--spp 4 --checkpoint run.state");
  must(folder, render + "--spp 8 --checkpoint run.state --resume -o run.exr --float");
  CHECK(equal(readImage(folder.path / "run.exr").rgb(), whole));
  must(folder, render + "--integrator pt --combine none --spp 4 --checkpoint plain.state");
  must(folder, render + "--integrator pt --spp 8 --checkpoint plain.state --resume -o plain.exr");
  CHECK(headlineOf(readImage(folder.path / "plain.exr")) == "combined.auto");
}

TEST_CASE("plan and preview have the defaults of render") {
  const Folder folder;
  const Run plan = must(folder, "plan " + kScene);
  CHECK(contains(plan.out, "+ auto: of pt"));
  CHECK(contains(must(folder, "plan --no-helpers " + kScene).out, "+ auto: of pt\n"));
  CHECK(contains(plan.out, "- sppm: "));
  CHECK(contains(must(folder, "plan " + kScene + "--spp 1").out, "+ auto: of pt"));
  CHECK(contains(must(folder, "plan " + kScene + "--integrator crn").out, "- auto: needs "));
  CHECK_FALSE(contains(must(folder, "plan " + kScene + "--combine none").out, "auto"));
  must(folder, "preview " + kScene + "--http 0 --size 32x24 --spp 8 -o out.exr");
  CHECK(headlineOf(readImage(folder.path / "out.exr")) == "combined.auto");
  CHECK_FALSE(hasLayer(readImage(folder.path / "out.exr"), "pt.mean"));
  const Run job = must(folder, "plan " + kScene + "-o out.exr --spp 16 --tasks 2 --format make");
  CHECK(contains(job.out, " --combine=auto"));
  CHECK(contains(job.out, " --aovs=features"));
}

}  // namespace braid::test_defaults
