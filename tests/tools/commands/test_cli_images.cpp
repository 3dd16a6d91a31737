// SPDX-License-Identifier: Apache-2.0
// The files that the real binary writes: channels, headers, replayed paths, equal bytes.
#include <set>

#include <doctest/doctest.h>

#include "combiners/statistics/error_map.h"
#include "renderer/film/files/exr.h"
#include "tests/support/command_line.h"
#include "tests/support/gltf_fixture.h"
#include "tests/tools/commands/cli_renders.h"

namespace braid::test_cli_images {

using namespace test::cli_renders;
using test::braidRun;
using test::contains;
using test::Folder;
using test::readText;
using test::Run;

namespace {

std::set<std::string> channels(const ImageFile& file) { return {file.channelNames.begin(), file.channelNames.end()}; }

// The first components of the channel names: layers, and plain R G B A.
std::set<std::string> layers(const ImageFile& file) {
  std::set<std::string> result;
  for (const std::string& name : file.channelNames) result.insert(name.substr(0, name.rfind('.')));
  return result;
}

const std::set<std::string> kHeadline = {"R", "G", "B"};
const std::set<std::string> kFeatures = {"R", "G", "B", "Albedo", "N", "Depth", "Visibility", "Error"};

}  // namespace

TEST_CASE("A render writes the documented channels and header") {
  const Folder folder;
  const ImageFile file = rendered(folder, "--seed 7");
  CHECK(file.width == 24);
  CHECK(file.height == 16);
  const std::set<std::string> names = channels(file);
  for (const char* layer :
       {"Albedo", "AlbedoA", "AlbedoB", "AlbedoVariance", "pt.mean", "pt.halfA", "pt.halfB", "pt.variance"})
    for (const char* c : {".R", ".G", ".B"}) CHECK_MESSAGE(names.count(std::string(layer) + c) == 1, layer, c);
  for (const char* name : {"R", "G", "B", "N.X", "N.Y", "N.Z", "Depth.Z", "Visibility.V"})
    CHECK_MESSAGE(names.count(name), name);
  CHECK(names.count("A") == 0);
  CHECK(names.count("pt.q0.R") == 0);
  for (const char* name : {"Software",
                           "braid/version",
                           "braid/renderingRevision",
                           "braid/build",
                           "braid/sceneHash",
                           "braid/plan",
                           "braid/planHash",
                           "braid/seed",
                           "braid/sampler",
                           "braid/filter",
                           "braid/maxDepth",
                           "braid/varianceIs",
                           "braid/rejectedSamples",
                           "braid/pt/passes",
                           "braid/pt/seconds",
                           "samplesPerPixel",
                           "renderTimeSeconds",
                           "worldToCamera",
                           "worldToNDC",
                           "chromaticities"})
    CHECK_MESSAGE(attribute(file, name), name);
  REQUIRE(attribute(file, "samplesPerPixel"));
  CHECK(attribute(file, "samplesPerPixel")->integer == 2);
  REQUIRE(attribute(file, "braid/seed"));
  CHECK(attribute(file, "braid/seed")->text == "7");
}

TEST_CASE("A photon map comes with its bias, and with an error map of variance and squared bias") {
  const Folder folder;
  const ImageFile file = rendered(folder, "--integrator sppm --spp 8");
  const std::set<std::string> names = channels(file);
  for (const char* layer :
       {"sppm.mean.R", "sppm.bias.R", "sppm.biasA.R", "sppm.biasB.R", "sppm.biasVariance.R", "Error.Y"})
    CHECK_MESSAGE(names.count(layer), layer);
  Estimate estimate;
  estimate.mean = file.rgb("sppm.mean");
  estimate.variance = file.rgb("sppm.variance");
  estimate.bias = file.rgb("sppm.bias");
  estimate.biasVariance = file.rgb("sppm.biasVariance");
  CHECK(file.planes.at("Error.Y").data == errorMap(estimate).data);
}

TEST_CASE("Options choose what is written") {
  const Folder folder;
  CHECK(layers(rendered(folder, "--aovs none")) == kHeadline);
  CHECK(layers(rendered(folder, "--aovs features")) == kFeatures);
  CHECK(channels(rendered(folder, "--aovs all --quarters")).count("pt.q3.B") == 1);
  CHECK(channels(rendered(folder, "--layer-prefix View")).count("View.pt.mean.R") == 1);
  const ImageFile half = rendered(folder, ""), full = rendered(folder, "--float");
  CHECK(full.planes.at("R").data == full.planes.at("pt.mean.R").data);
  CHECK(half.planes.at("R").data != half.planes.at("pt.mean.R").data);
  CHECK(half.planes.at("pt.mean.R").data == full.planes.at("pt.mean.R").data);

  const ImageFile crop = rendered(folder, "--crop 3,5,14,9");
  CHECK(crop.window == PixelWindow{3, 5, 14, 9});
  CHECK(crop.fullWidth == 24);
  CHECK(crop.fullHeight == 16);
  CHECK(crop.planes.at("pt.mean.G").at(0, 0) == full.planes.at("pt.mean.G").at(3, 5));
  CHECK(crop.planes.at("pt.mean.G").at(10, 3) == full.planes.at("pt.mean.G").at(13, 8));

  rendered(folder, "--png view.png");
  const ImageFile png = readImage(folder.path / "view.png");
  CHECK(png.width == 24);
  CHECK(png.height == 16);
}

TEST_CASE("A transparent background comes as a channel A") {
  const Folder folder;
  test::GltfFile file = test::quadFile();
  test::giveMaterial(
      file,
      {{"alphaMode", "BLEND"}, {"doubleSided", true}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.4}}}}});
  folder.write("quad.glb", file.glb());
  const ImageFile image =
      rendered(folder, "--spp 256 --transparent --look-at 0.5,0.5,2,0.5,0.5,0 --yfov 60", "quad.glb");
  REQUIRE(channels(image).count("A") == 1);
  const Plane<float>& alpha = image.planes.at("A");
  CHECK(alpha.at(0, 0) == 0);
  CHECK(image.planes.at("R").at(0, 0) == 0);
  // 256 samples of a coin: five standard deviations are 0.153.
  CHECK(std::fabs(alpha.at(12, 8) - 0.4f) < 0.154f);
  CHECK(image.planes.at("R").at(12, 8) > 0);
}

TEST_CASE("A replayed path returns what the render stored") {
  const Folder folder;
  const std::string view = " --size 24x16 --seed 3";
  REQUIRE(braidRun(folder, renderCommand("--spp 1" + view)).code == 0);
  const ImageFile image = readImage(folder.path / "out.exr");
  for (const auto& [x, y] : {std::pair(12, 8), std::pair(3, 3), std::pair(20, 14), std::pair(7, 12)}) {
    const Run run =
        braidRun(folder, "replay " + kCornell + view + " --pixel " + std::to_string(x) + ',' + std::to_string(y));
    CHECK(run.code == 0);
    const size_t at = run.out.rfind("radiance (");
    REQUIRE(at != std::string::npos);
    float v[3] = {-1, -1, -1};
    REQUIRE(std::sscanf(run.out.c_str() + at, "radiance (%f %f %f)", &v[0], &v[1], &v[2]) == 3);
    // One ray at a time rounds otherwise than a packet of rays.
    const char* names[] = {"pt.mean.R", "pt.mean.G", "pt.mean.B"};
    for (int c = 0; c < 3; ++c) CHECK(v[c] == doctest::Approx(image.planes.at(names[c]).at(x, y)).epsilon(1e-3));
  }
  CHECK(braidRun(folder, "replay " + kCornell + view + " --pixel 24,0").code == 1);
}

TEST_CASE("Reproducible renders are equal byte for byte") {
  const Folder folder;
  for (const char* name : {"a.exr", "b.exr"})
    REQUIRE(braidRun(folder, renderCommand(std::string("--size 40x30 --reproducible -o ") + name)).code == 0);
  CHECK(readText(folder.path / "a.exr") == readText(folder.path / "b.exr"));
  const Run same = braidRun(folder, "compare a.exr b.exr --metric relMSE,MSE --max 0");
  CHECK(same.code == 0);
  CHECK(contains(same.out, "relMSE 0\n"));
  CHECK(contains(same.out, "MSE 0\n"));
  REQUIRE(braidRun(folder, renderCommand("--size 40x30 --seed 9 -o c.exr")).code == 0);
  CHECK(braidRun(folder, "compare a.exr c.exr --metric relMSE --max 0").code == 6);
}

}  // namespace braid::test_cli_images
