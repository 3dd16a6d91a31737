// SPDX-License-Identifier: Apache-2.0
// Combining on the command line: in `braid render`, in `braid combine`, and from the files of other renderers.
#include <cstdlib>
#include <iterator>
#include <set>

#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

#include "combiners/pipeline/pipeline.h"
#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/command_line.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"
#include "tools/images/estimates_file.h"

namespace braid::test_combine_cli {

using test::braidRun;
using test::contains;
using test::Folder;
using test::identical;
using test::readText;
using test::Run;
namespace fs = std::filesystem;

namespace {

Run rendered(const Folder& folder, const std::string& rest) {
  const Run run = braidRun(
      folder, "render '" BRAID_SOURCE_DIR "/scenes/cornell.glb' -q --size 32x24 --spp 8 " + test::plainly(rest));
  INFO(run.err);
  REQUIRE(run.code == 0);
  return run;
}

Run combined(const Folder& folder, const std::string& rest) {
  const Run run = braidRun(folder, "combine -q --float " + rest);
  INFO(run.err);
  REQUIRE(run.code == 0);
  return run;
}

const Attribute* attribute(const ImageFile& file, const std::string& name) {
  for (const Attribute& a : file.attributes)
    if (a.name == name) return &a;
  return nullptr;
}

// An EXR with any channels, each filled with its own values: channel c of pixel i is base + c + i / 1000.
void writeChannels(const std::string& path, const std::vector<std::string>& names, float base = 1, int samples = 0,
                   const char* cyclesSamples = nullptr) {
  const int width = 12, height = 10;
  OIIO::ImageSpec spec(width, height, static_cast<int>(names.size()), OIIO::TypeDesc::FLOAT);
  spec.channelnames = names;
  if (samples > 0) spec.attribute("samplesPerPixel", samples);
  if (cyclesSamples) spec.attribute("cycles.ViewLayer.samples", cyclesSamples);
  std::vector<float> data;
  for (int i = 0; i < width * height; ++i)
    for (size_t c = 0; c < names.size(); ++c)
      data.push_back(base + static_cast<float>(c) + static_cast<float>(i) / 1000);
  const auto out = OIIO::ImageOutput::create(path);
  REQUIRE(out);
  REQUIRE(out->open(path, spec));
  REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, data.data()));
  REQUIRE(out->close());
}

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

TEST_CASE("A render combines in process and writes what it made") {
  const Folder folder;
  rendered(folder, "--combine inverse-variance@box,easy@box --denoiser box --weights --float -o out.exr");
  const ImageFile file = readImage(folder.path / "out.exr");
  for (const char* layer : {"combined.inverse-variance@box", "combined.easy@box", "box.mean", "box.halfA", "box.halfB",
                            "pt.mean", "Error", "weight.inverse-variance", "weight.easy"})
    CHECK_MESSAGE(hasLayer(file, layer), layer);
  CHECK(identical(file.rgb(), file.rgb("combined.easy@box")));
  CHECK_FALSE(identical(file.rgb(), file.rgb("pt.mean")));
  REQUIRE(attribute(file, "braid/headline"));
  CHECK(attribute(file, "braid/headline")->text == "combined.easy@box");
  REQUIRE(attribute(file, "braid/easy@box/biased"));
  CHECK(attribute(file, "braid/easy@box/biased")->text == "box");
  for (const char* name : {"braid/easy@box/seconds", "braid/easy@box/inputSeconds", "braid/exposure",
                           "braid/box/unbiased", "braid/pt/unbiased", "braid/easy@box/sureMapFilterSigma"})
    CHECK_MESSAGE(attribute(file, name), name);

  rendered(folder, "--float -o plain.exr");
  const ImageFile plain = readImage(folder.path / "plain.exr");
  CHECK(identical(plain.rgb(), plain.rgb("pt.mean")));
  CHECK(identical(plain.rgb("pt.mean"), file.rgb("pt.mean")));
  for (const std::string& name : plain.channelNames) CHECK_FALSE(contains(name, "combined"));
  rendered(folder, "--denoiser box --float -o kept.exr");
  CHECK(hasLayer(readImage(folder.path / "kept.exr"), "box.mean"));
  CHECK(identical(readImage(folder.path / "kept.exr").rgb(), plain.rgb()));
}

TEST_CASE("Combined later from the file, the images are the same bit for bit") {
  const Folder folder;
  const std::string methods = "box,inverse-variance@box,easy@box,inverse-variance@easy@box";
  rendered(folder, "--combine " + methods + " --quarters --history --float -o render.exr");
  combined(folder, "--unbiased render.exr --method " + methods + " -o later.exr");
  const ImageFile a = readImage(folder.path / "render.exr"), b = readImage(folder.path / "later.exr");
  for (const char* m : {"box", "inverse-variance@box", "easy@box", "inverse-variance@easy@box"})
    CHECK_MESSAGE(identical(a.rgb(std::string("combined.") + m), b.rgb(std::string("combined.") + m)), m);
  CHECK(identical(a.rgb("Error"), b.rgb("Error")));
  CHECK(identical(a.rgb(), b.rgb()));

  // By another way to the same chain, on other numbers of threads.
  combined(folder, "--unbiased render.exr --method inverse-variance --biased easy --denoiser box --threads 3 -o c.exr");
  CHECK(identical(readImage(folder.path / "c.exr").rgb(), b.rgb()));
  // And with the denoised image taken from the file.
  combined(folder, "--unbiased render.exr:pt --method inverse-variance --biased later.exr:box -o d.exr");
  const Rgb<float> fromFile = readImage(folder.path / "d.exr").rgb();  // rounded once more
  CHECK(std::sqrt(test::meanSquaredError(fromFile, b.rgb("combined.inverse-variance@box"))) <
        1e-6 * test::meanOfImage(fromFile));
  combined(folder, "--unbiased render.exr --method box --box-radius 0 --reproducible -o e.exr");
  const Rgb<float> same = readImage(folder.path / "e.exr").rgb();
  CHECK(std::sqrt(test::meanSquaredError(same, a.rgb("pt.mean"))) < 1e-6 * test::meanOfImage(same));
}

TEST_CASE("A session keeps the variances after 1, 2, 4, … rounds when asked") {
  const Scene scene(cornellBox());
  Settings settings = test::settingsFor(16, 12, 9);
  CHECK(test::render(scene, settings).estimates->history.empty());
  settings.keep.history = true;
  const auto nine = test::render(scene, settings).estimates;
  REQUIRE(nine->history.count("pt") == 1);
  const std::vector<Checkpoint>& history = nine->history.at("pt");
  REQUIRE(history.size() == 4);
  for (size_t i = 0; i < 4; ++i) {
    settings.spp = uint64_t(1) << i;
    CHECK(history[i].passes == settings.spp);
    CHECK(identical(history[i].variance, test::render(scene, settings).estimates->estimates[0].variance));
    if (i > 0) CHECK(history[i].seconds > history[i - 1].seconds);
  }
}

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

TEST_CASE("A reference file is what the best choice in hindsight goes by") {
  const Folder folder;
  rendered(folder, "--float -o noisy.exr");
  const auto image = [&](const std::string& arguments) {
    const Run run = braidRun(folder, "combine -q --float --unbiased noisy.exr -o o.exr " + arguments);
    INFO(run.err);
    REQUIRE(run.code == 0);
    fs::copy_file(folder.path / "o.exr", folder.path / "last.exr", fs::copy_options::overwrite_existing);
    return readImage(folder.path / "o.exr").rgb();
  };
  const Rgb<float> noisy = readImage(folder.path / "noisy.exr").rgb(), box = image("--method box");
  const Rgb<float> likeBox = image("--method ideal@box --reference last.exr"),
                   likeNoisy = image("--method ideal@box --reference noisy.exr");
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < box.size(); ++i) {
      CHECK(likeBox[c][i] == doctest::Approx(box[c][i]).epsilon(1e-5));
      CHECK(likeNoisy[c][i] == doctest::Approx(noisy[c][i]).epsilon(1e-5));
    }
}

TEST_CASE("Errors of combining end with their exit codes and one line") {
  const Folder folder;
  writeChannels(folder.path / "a.exr", {"R", "G", "B"});
  const auto refused = [&](const std::string& arguments, int code, const std::string& part) {
    const Run run = braidRun(folder, arguments.starts_with("render") ? test::plainly(arguments) : arguments);
    INFO(arguments, ": ", run.err);
    CHECK(run.code == code);
    CHECK(contains(run.err, part));
    CHECK_FALSE(fs::exists(folder.path / "o.exr"));
  };
  refused("combine --unbiased a.exr --method jss -o o.exr", 1, "unknown method 'jss': known are ");
  refused("combine --unbiased a.exr --method , -o o.exr", 1, "at least one");
  refused("combine --unbiased a.exr -o o.exr", 1, "--method");
  refused("combine --unbiased none.exr --method box -o o.exr", 2, "none.exr: no such file");
  refused("combine --unbiased a.exr --method box -o nowhere/o.exr", 3, "nowhere");
  refused("combine --unbiased a.exr --method box --aovs some -o o.exr", 1, "none, features, all");
  const std::string render = "render '" BRAID_SOURCE_DIR "/scenes/cornell.glb' -q --size 16x12 --spp 4 -o o.exr ";
  refused(render + "--combine jss", 1, "unknown method 'jss'");
  refused(render + "--denoiser jss", 1, "unknown method 'jss'");
  refused(render + "--combine average --bases box", 1, "average cannot run: needs 2 bases");
  refused(render + "--combine inverse-variance@box --spp 1", 1, "");

  rendered(folder, "-o big.exr");
  refused("combine --unbiased big.exr --biased a.exr --method inverse-variance -o o.exr", 2, "12x10 pixels");
  refused("combine --unbiased big.exr --method ideal@box -o o.exr", 2, "needs a reference: combine --reference FILE");
  refused("combine --unbiased big.exr --reference a.exr --method ideal@box -o o.exr", 2, "a.exr: 12x10 pixels");
  refused(render + "--combine ideal@box", 1, "needs a reference");
  refused("combine --unbiased big.exr:bdpt --method box -o o.exr", 2, "no estimate 'bdpt': it has pt");
}

TEST_CASE("Lists, plans and help show methods with their reasons and options") {
  const Folder folder;
  const Run list = braidRun(folder, "--list");
  for (const char* word : {"denoisers", "  box ", "  external ", "combiners", "  average ", "  easy "})
    CHECK_MESSAGE(contains(list.out, word), word);
  const std::string scene = "plan '" BRAID_SOURCE_DIR "/scenes/cornell.glb' ";
  CHECK(contains(braidRun(folder, scene + "--integrator pt --combine easy@box").out, "+ easy@box: of pt and box"));
  CHECK(contains(braidRun(folder, scene + "--combine average --bases box").out, "- average: needs 2 bases"));
  CHECK(contains(braidRun(folder, test::plainly(scene)).out, "- history: "));
  for (const char* command : {"combine", "render"})
    CHECK(contains(braidRun(folder, std::string(command) + " --help-methods").out, "--box-radius"));
}

TEST_CASE("auto fuses what an auto plan rendered, offline as in process") {
  const Folder folder;
  const Run run = braidRun(folder, "render '" BRAID_SOURCE_DIR
                                   "/scenes/torus_glass.glb' -q --size 48x27 --spp 8 "
                                   "--float -o a.exr --quarters --reproducible");
  INFO(run.err);
  REQUIRE(run.code == 0);
  const ImageFile a = readImage(folder.path / "a.exr");
  REQUIRE(attribute(a, "braid/auto/bases"));
  CHECK(attribute(a, "braid/auto/bases")->text == "sppm");
  CHECK(a.planes.count("Error.Y") == 1);
  combined(folder, "--unbiased a.exr --method auto -o b.exr");
  CHECK(identical(a.rgb("combined.auto"), readImage(folder.path / "b.exr").rgb("combined.auto")));
  // Named a second time the photon map still counts once.
  combined(folder, "--unbiased a.exr --biased a.exr:sppm --method auto -o c.exr");
  CHECK(identical(a.rgb("combined.auto"), readImage(folder.path / "c.exr").rgb("combined.auto")));
}

TEST_CASE("auto filters direct and indirect light apart, offline as in process") {
  const Folder folder;
  const std::string options = "render '" BRAID_SOURCE_DIR "/scenes/cornell.glb' -q --size 48x27 --spp 8 --float ";
  REQUIRE(braidRun(folder, options + "--integrator pt --quarters --direct-indirect -o a.exr").code == 0);
  REQUIRE(braidRun(folder, test::plainly(options + "--quarters --direct-indirect -o b.exr")).code == 0);
  const ImageFile a = readImage(folder.path / "a.exr");
  for (const char* layer : {"pt.direct", "pt.directA", "pt.directB", "pt.directVariance", "pt.indirectVariance"})
    CHECK_MESSAGE(hasLayer(a, layer), layer);
  for (const char* file : {"a.exr", "b.exr"}) {
    combined(folder, "--unbiased " + std::string(file) + " --method auto -o c.exr");
    CHECK(identical(a.rgb("combined.auto"), readImage(folder.path / "c.exr").rgb("combined.auto")));
  }
  // Parts of one file are not those of two files' mean.
  REQUIRE(braidRun(folder, options + "--quarters --direct-indirect --seed 1 -o e.exr").code == 0);
  for (const char* parts : {"0", "1"})
    combined(folder, std::string("--unbiased a.exr,e.exr --method auto -o two") + parts +
                         ".exr --auto-direct-indirect " + parts);
  CHECK(identical(readImage(folder.path / "two0.exr").rgb("combined.auto"),
                  readImage(folder.path / "two1.exr").rgb("combined.auto")));
  combined(folder, "--unbiased a.exr --method auto --auto-direct-indirect 0 -o d.exr");
  CHECK_FALSE(identical(a.rgb("combined.auto"), readImage(folder.path / "d.exr").rgb("combined.auto")));
}

TEST_CASE("bench tells what denoisers and combiners cost, inputs first") {
  const Folder folder;
  const Run run = braidRun(folder, "bench --combine pw,js@pw,uncorrelated --size 32x24 --spp 8 --repeats 1 --json");
  INFO(run.err);
  REQUIRE(run.code == 0);
  const nlohmann::json methods = nlohmann::json::parse(run.out)["combining"][0]["methods"];
  REQUIRE(methods.size() == 3);
  for (const nlohmann::json& m : methods) {
    CHECK(!m.contains("skipReason"));
    CHECK(m["seconds"].get<double>() > 0);
    CHECK(m["secondsPerMegapixel"].get<double>() ==
          doctest::Approx(m["seconds"].get<double>() * 1e6 / (32 * 24)).epsilon(1e-6));
  }
  CHECK(methods[0]["method"] == "pw");
}

}  // namespace braid::test_combine_cli
