// SPDX-License-Identifier: Apache-2.0
// Combining on the command line from the files of other renderers.
#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/command_line.h"
#include "tests/support/gltf_fixture.h"
#include "tools/images/estimates_file.h"
#include "tests/tools/commands/combine_files.h"

namespace braid::test_combine_cli_foreign {

namespace fs = std::filesystem;
using namespace test::combine_files;
using test::braidRun;
using test::contains;
using test::Folder;
using test::identical;
using test::Run;

namespace {

std::vector<std::string> channelsOf(const std::vector<std::pair<std::string, std::string>>& layers) {
  std::vector<std::string> names;
  for (const auto& [layer, components] : layers)
    for (const char c : components) names.push_back(layer.empty() ? std::string(1, c) : layer + "." + c);
  return names;
}

// Where the values of a layer of writeChannels() begin.
float firstOf(const std::vector<std::string>& names, const std::string& channel) {
  return 1 + static_cast<float>(std::find(names.begin(), names.end(), channel) - names.begin());
}

}  // namespace

TEST_CASE("pbrt's films are read, their variance of one sample as that of the mean") {
  const Folder folder;
  const auto names = channelsOf({{"", "RGB"},
                                 {"Albedo", "RGB"},
                                 {"P", "XYZ"},
                                 {"N", "XYZ"},
                                 {"Ns", "XYZ"},
                                 {"Variance", "RGB"},
                                 {"RelativeVariance", "RGB"}});
  const std::string path = folder.path / "pbrt.exr";
  writeChannels(path, names, 1, 16);
  std::vector<std::string> notes;
  const Estimates e = readEstimates(readImage(path), {"image", ImageRole::Noisy, 0, &notes});
  REQUIRE(e.estimates.size() == 1);
  CHECK(e.estimates[0].passes == 16);
  CHECK(e.estimates[0].mean[1][0] == firstOf(names, "G"));
  CHECK(e.estimates[0].variance[2][0] == doctest::Approx(firstOf(names, "Variance.B") / 16));
  REQUIRE(e.features.has_value());
  CHECK(e.features->albedo.mean[0][0] == firstOf(names, "Albedo.R"));
  CHECK(e.features->normal.mean[2][0] == firstOf(names, "Ns.Z"));
  CHECK(identical(e.features->albedo.half[1], e.features->albedo.mean));
  CHECK(e.features->normal.variance[0][5] == 0);
  const float p = firstOf(names, "P.X");
  CHECK(e.features->depth.mean[0] == doctest::Approx(glm::length(Vec3(p, p + 1, p + 2))));
  CHECK(notes.empty());

  // Without the number of samples it says so, unless that is given.
  writeChannels(path, names, 1);
  CHECK(readEstimates(readImage(path), {"image", ImageRole::Noisy, 0, &notes}).estimates[0].variance.empty());
  REQUIRE(notes.size() == 1);
  CHECK(contains(notes[0], "--spp"));
  CHECK(readEstimates(readImage(path), {"image", ImageRole::Noisy, 4, nullptr}).estimates[0].variance[0][0] ==
        doctest::Approx(firstOf(names, "Variance.R") / 4));
}

TEST_CASE("Cycles' passes are read, noisy or denoised by what they are for") {
  const Folder folder;
  const auto names = channelsOf({{"ViewLayer.Combined", "RGBA"},
                                 {"ViewLayer.Denoising Albedo", "RGB"},
                                 {"ViewLayer.Denoising Depth", "Z"},
                                 {"ViewLayer.Denoising Normal", "XYZ"},
                                 {"ViewLayer.Noisy Image", "RGBA"}});
  const std::string path = folder.path / "cycles.exr";
  writeChannels(path, names, 1, 0, "128");
  const ImageFile file = readImage(path);
  const Estimates noisy = readEstimates(file), denoised = readEstimates(file, {"d", ImageRole::Denoised, 0, nullptr});
  CHECK(noisy.estimates[0].mean[1][0] == firstOf(names, "ViewLayer.Noisy Image.G"));
  CHECK(noisy.estimates[0].passes == 128);
  CHECK(noisy.estimates[0].unbiased);
  CHECK(denoised.estimates[0].mean[1][0] == firstOf(names, "ViewLayer.Combined.G"));
  CHECK_FALSE(denoised.estimates[0].unbiased);
  REQUIRE(noisy.features.has_value());
  CHECK(noisy.features->albedo.mean[2][0] == firstOf(names, "ViewLayer.Denoising Albedo.B"));
  CHECK(noisy.features->normal.mean[1][0] == firstOf(names, "ViewLayer.Denoising Normal.Y"));
  CHECK(noisy.features->depth.mean[0] == firstOf(names, "ViewLayer.Denoising Depth.Z"));
  writeChannels(path, channelsOf({{"ViewLayer.Combined", "RGBA"}}));
  std::vector<std::string> notes;
  const Estimates plain = readEstimates(readImage(path), {"image", ImageRole::Noisy, 0, &notes});
  CHECK(plain.estimates[0].mean[0][0] == 1);
  CHECK_FALSE(plain.features.has_value());
  REQUIRE(notes.size() == 2);
  CHECK(contains(notes[0], "reads 'ViewLayer.Combined'"));
  CHECK(contains(notes[1], "no albedo and no normal"));
}

TEST_CASE("Mitsuba's AOVs and second moments are read") {
  const Folder folder;
  const std::string path = folder.path / "mitsuba.exr";
  writeChannels(path, {"img.R", "img.G", "img.B", "img.A", "albedo.R", "albedo.G", "albedo.B", "dd.T", "sh_normal.X",
                       "sh_normal.Y", "sh_normal.Z", "m2_img.R", "m2_img.G", "m2_img.B"});
  const Estimates e = readEstimates(readImage(path), {"image", ImageRole::Noisy, 9, nullptr});
  CHECK(e.estimates[0].mean[2][0] == 3);
  // Second moment 12 over the mean 1: variance of a sample 11, of the mean 11 / 8.
  CHECK(e.estimates[0].variance[0][0] == doctest::Approx(11.0 / 8));
  REQUIRE(e.features.has_value());
  CHECK(e.features->albedo.mean[0][0] == 5);
  CHECK(e.features->depth.mean[0] == 8);
  CHECK(e.features->normal.mean[0][0] == 9);
}

TEST_CASE("Two renders of another renderer are halves, with a variance from their difference") {
  const Folder folder;
  writeChannels(folder.path / "a.exr", {"R", "G", "B"}, 1);
  writeChannels(folder.path / "b.exr", {"R", "G", "B"}, 2);
  std::vector<std::string> notes;
  const std::string a = folder.path / "a.exr", b = folder.path / "b.exr";
  const Estimates e = readEstimatesOption(a + "," + b, {"image", ImageRole::Noisy, 0, &notes});
  CHECK(e.estimates[0].mean[0][0] == 1.5f);
  CHECK(e.estimates[0].half[1][0][0] == 2);
  CHECK(e.estimates[0].variance[0][0] == 0.25f);
  CHECK(std::any_of(notes.begin(), notes.end(), [](const std::string& n) { return contains(n, "no variance"); }));
  combined(folder, "--unbiased a.exr,b.exr --method inverse-variance --denoiser box -o out.exr");
  CHECK(hasLayer(readImage(folder.path / "out.exr"), "Error"));

  // One alone: what is missing is worked out from the image, and what cannot be is named.
  const Run one = braidRun(folder, "combine --unbiased a.exr --method inverse-variance --denoiser box -o one.exr");
  CHECK(one.code == 0);
  CHECK(contains(one.err, "two renders with different seeds"));
  const Run run = braidRun(folder, "combine --unbiased a.exr --method uncorrelated-uniform -o no.exr");
  CHECK(run.code == 2);
  CHECK(contains(run.err, "uncorrelated-uniform cannot run: needs an estimate with correlated pixels"));
  CHECK(contains(run.err, "can run on these files: box"));
  CHECK_FALSE(fs::exists(folder.path / "no.exr"));
  combined(folder, "--unbiased a.exr --method box -o out.exr");

  // A denoised image of another renderer as the biased input, with its halves.
  writeChannels(folder.path / "d.exr", {"R", "G", "B"}, 1.25f);
  writeChannels(folder.path / "e.exr", {"R", "G", "B"}, 1.5f);
  combined(folder, "--unbiased a.exr,b.exr --biased d.exr,d.exr,e.exr --method inverse-variance -o out.exr");
  CHECK(braidRun(folder, "combine --unbiased a.exr,b.exr --biased d.exr,d.exr,d.exr --method inverse-variance -o o.exr")
            .code == 2);
  CHECK(braidRun(folder, "combine --unbiased a.exr,b.exr --biased d.exr --method inverse-variance -o out.exr").code ==
        2);
  combined(folder, "--unbiased a.exr --bases a.exr,d.exr --method average -o mean.exr");
  CHECK(readImage(folder.path / "mean.exr").rgb()[0][0] == doctest::Approx(1.125));
}

}  // namespace braid::test_combine_cli_foreign
