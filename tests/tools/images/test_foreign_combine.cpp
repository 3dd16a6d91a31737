// SPDX-License-Identifier: Apache-2.0
// One image of another renderer is enough: every method that is said to run does. Images that do not belong together
// are refused.
#include <doctest/doctest.h>

#include "tests/support/every_method.h"
#include "tests/support/command_line.h"
#include "tests/support/foreign_files.h"
#include "tests/support/render_fixture.h"
#include "tools/images/estimates_file.h"
#include "tests/tools/images/foreign_cases.h"

namespace braid::test_foreign_combine {

using namespace test;
using namespace test::foreign_cases;

namespace {

// Files of three renderers with the image, and features where these write them.
ForeignChannels cyclesChannels(const Case& c) {
  ForeignChannels f;
  f.add("ViewLayer.Combined", "RGB", c.pt().mean);
  f.add("ViewLayer.Denoising Albedo", "RGB", c.estimates.features->albedo.mean);
  f.add("ViewLayer.Denoising Normal", "XYZ", c.estimates.features->normal.mean);
  f.add("ViewLayer.Depth.Z", c.estimates.features->depth.mean);
  return f;
}

ForeignChannels mitsubaChannels(const Case& c) {
  ForeignChannels f;
  f.add("", "RGB", c.pt().mean);
  f.add("albedo", "RGB", c.estimates.features->albedo.mean);
  f.add("sh_normal", "XYZ", c.estimates.features->normal.mean);
  f.add("dd.T", c.estimates.features->depth.mean);
  return f;
}

ForeignChannels plainChannels(const Case& c) {
  ForeignChannels f;
  f.add("", "RGB", c.pt().mean);
  return f;
}

Run combined(const Folder& folder, const std::string& arguments, int code = 0) {
  const Run run = braidRun(folder, "combine --float " + arguments);
  INFO(arguments, ": ", run.err);
  CHECK(run.code == code);
  return run;
}

// The methods of "what can run on these files: a, b".
std::vector<std::string> offered(const std::string& text) {
  const std::string start = "what can run on these files: ";
  const size_t at = text.find(start);
  REQUIRE(at != std::string::npos);
  std::vector<std::string> names;
  std::string rest = text.substr(at + start.size(), text.find('\n', at) - at - start.size());
  for (size_t begin = 0; begin < rest.size();) {
    const size_t end = std::min(rest.find(", ", begin), rest.size());
    names.push_back(rest.substr(begin, end - begin));
    begin = end + 2;
  }
  return names;
}

}  // namespace

TEST_CASE("One image of Cycles, Mitsuba or no one known: every method that is said to run does") {
  const Folder folder;
  const Case c = noisyCase(48, 36);
  writeForeign(folder.path / "cycles.exr", cyclesChannels(c), 0, {{"cycles.ViewLayer.samples", "16"}});
  writeForeign(folder.path / "mitsuba.exr", mitsubaChannels(c));
  writeForeign(folder.path / "plain.exr", plainChannels(c));
  for (const std::string name : {"cycles", "mitsuba", "plain"}) {
    CAPTURE(name);
    const std::string unbiased = "--unbiased " + name + ".exr ";
    const Run refused = combined(folder, unbiased + "--method uncorrelated-uniform -o no.exr", 2);
    CHECK(contains(refused.err, "needs an estimate with correlated pixels"));
    const std::vector<std::string> methods = offered(refused.err);
    for (const char* m : {"pw", "nlm", "rdfc", "nfor", "auto", "js", "double-shrinkage"})
      CHECK_MESSAGE(std::find(methods.begin(), methods.end(), m) != methods.end(), m);
    std::string all;
    for (const std::string& m : methods) all += (all.empty() ? "" : ",") + m;
    combined(folder, unbiased + "--method " + all + " -o all.exr");
    const ImageFile file = readImage(folder.path / "all.exr");
    for (const std::string& m : methods) CHECK_MESSAGE(hasLayer(file, "combined." + m), m);
  }
}

TEST_CASE("One image: filters and auto take noise out of it, and the file and the screen say what is made up") {
  const Folder folder;
  const Case c = noisyCase();
  writeForeign(folder.path / "cycles.exr", cyclesChannels(c));
  writeForeign(folder.path / "plain.exr", plainChannels(c));
  for (const std::string name : {"cycles", "plain"}) {
    CAPTURE(name);
    const Run run = combined(folder, "--unbiased " + name + ".exr --method pw,nfor,rdfc,auto -o o.exr");
    CHECK(contains(run.err, "variance of unbiased: estimated from the differences of neighbouring pixels"));
    CHECK(contains(run.err, "halves of unbiased: the image plus and minus noise"));
    const ImageFile file = readImage(folder.path / "o.exr");
    int told = 0;
    for (const Attribute& a : file.attributes)
      told += a.name == "braid/unbiased/variance" || a.name == "braid/unbiased/halves";
    CHECK(told == 2);
    const double before = meanSquaredError(c.pt().mean, c.truth);
    for (const char* m : {"pw", "nfor", "rdfc", "auto"}) {
      const double after = meanSquaredError(file.rgb(std::string("combined.") + m), c.truth);
      CAPTURE(std::string(m));
      CAPTURE(after / before);
      CHECK(after < 0.6 * before);
    }
  }
}

TEST_CASE("A film of pbrt, with the variance of a sample, runs auto") {
  const Folder folder;
  const Case c = noisyCase();
  Rgb<float> perSample = c.pt().variance;
  for (size_t k = 0; k < 3; ++k)
    for (float& v : perSample[k].data) v *= 16;
  ForeignChannels f = plainChannels(c);
  f.add("Albedo", "RGB", c.estimates.features->albedo.mean);
  f.add("Ns", "XYZ", c.estimates.features->normal.mean);
  f.add("Variance", "RGB", perSample);
  writeForeign(folder.path / "pbrt.exr", f, 16);
  const Run run = combined(folder, "--unbiased pbrt.exr --method auto -o o.exr");
  CHECK_FALSE(contains(run.err, "variance of unbiased: estimated"));
  CHECK(contains(run.err, "halves of unbiased: the image plus and minus noise"));
  const ImageFile file = readImage(folder.path / "o.exr");
  CHECK(meanSquaredError(file.rgb(), c.truth) < 0.5 * meanSquaredError(c.pt().mean, c.truth));
  CHECK(hasLayer(file, "Error"));
  for (size_t i = 0; i < c.truth.size(); ++i)
    REQUIRE(file.rgb("unbiased.variance")[1][i] == doctest::Approx(c.pt().variance[1][i]));
}

TEST_CASE("Invalid pixels of a foreign file are told and filled") {
  const Folder folder;
  Case c = noisyCase(48, 36);
  Estimate& pt = c.estimates.estimates[0];
  pt.mean[0].at(10, 10) = std::numeric_limits<float>::quiet_NaN();
  pt.mean[2].at(30, 20) = kInfinity;
  writeForeign(folder.path / "bad.exr", plainChannels(c));
  const Run run = combined(folder, "--unbiased bad.exr --method nlm,auto -o o.exr");
  CHECK(contains(run.err, "bad.exr: 2 pixels are not finite"));
  const Rgb<float> image = readImage(folder.path / "o.exr").rgb();
  for (const auto& [x, y] : {std::pair(10, 10), {30, 20}})
    for (size_t k = 0; k < 3; ++k) {
      CHECK(image[k].at(x, y) > 0.2f * c.truth[k].at(x, y));
      CHECK(image[k].at(x, y) < 5 * c.truth[k].at(x, y));
    }
}

TEST_CASE("Alpha is kept, of one image and of two halves") {
  const Folder folder;
  const Case c = noisyCase(16, 12), d = noisyCase(16, 12, 0.5);
  Plane<float> alpha(16, 12), other(16, 12, 0.5f);
  for (size_t i = 0; i < alpha.size(); ++i) alpha[i] = static_cast<float>(i % 5) / 4;
  ForeignChannels one = cyclesChannels(c), two = cyclesChannels(d), plain = plainChannels(c);
  one.add("ViewLayer.Combined.A", alpha);
  two.add("ViewLayer.Combined.A", other);
  plain.add("A", alpha);
  writeForeign(folder.path / "one.exr", one);
  writeForeign(folder.path / "two.exr", two);
  writeForeign(folder.path / "plain.exr", plain);
  const auto alphaOf = [&](const std::string& unbiased) {
    combined(folder, "-q --unbiased " + unbiased + " --method nlm -o o.exr");
    const ImageFile file = readImage(folder.path / "o.exr");
    REQUIRE(file.planes.count("A") == 1);
    return file.planes.at("A");
  };
  for (size_t i = 0; i < alpha.size(); ++i) {
    if (i > 0) continue;
    CHECK(alphaOf("one.exr").data[7] == alpha[7]);
    CHECK(alphaOf("plain.exr").data[7] == alpha[7]);
    CHECK(alphaOf("one.exr,two.exr").data[7] == 0.5f * alpha[7] + 0.25f);
  }
}

TEST_CASE("View layers are named, and a user chooses another") {
  const Folder folder;
  const Case c = noisyCase(16, 12), d = noisyCase(16, 12, 0.5);
  ForeignChannels f;
  f.add("Composite.Combined", "RGB", d.pt().mean);
  f.add("Glass.Combined", "RGB", d.pt().mean);
  f.add("Glass.Denoising Albedo", "RGB", d.denoised[0].mean);
  const ForeignChannels view = cyclesChannels(c);
  for (size_t k = 0; k < view.names.size(); ++k) f.add(view.names[k], *view.planes[k]);
  writeForeign(folder.path / "layers.exr", f, 0, {{"cycles.Glass.samples", "8"}, {"cycles.ViewLayer.samples", "32"}});
  const auto read = [&](const std::string& what, std::vector<std::string>* notes) {
    ReadOptions options;
    options.notes = notes;
    return readEstimatesOption(folder.path / what, options);
  };
  std::vector<std::string> notes;
  const Estimates first = read("layers.exr", &notes);
  CHECK(identical(first.estimates[0].mean, d.pt().mean));
  CHECK(first.estimates[0].passes == 8);
  CHECK(identical(first.features->albedo.mean, d.denoised[0].mean));
  REQUIRE_FALSE(notes.empty());
  CHECK(contains(notes[0], "reads 'Glass.Combined'; its other view layers are 'ViewLayer', 'Composite'"));
  CHECK(contains(notes[0], ":LAYER"));
  for (const char* name : {"layers.exr:ViewLayer", "layers.exr:ViewLayer.Combined"}) {
    const Estimates other = read(name, nullptr);
    CHECK(identical(other.estimates[0].mean, c.pt().mean));
    CHECK(identical(other.features->albedo.mean, c.estimates.features->albedo.mean));
    CHECK(other.estimates[0].passes == 32);
  }
  const Run run = combined(folder, "--unbiased layers.exr:Wood --method nlm -o o.exr", 2);
  CHECK(contains(run.err, "no layer 'Wood'; it has 'Glass', 'ViewLayer', 'Composite'"));
  combined(folder, "--unbiased layers.exr:ViewLayer --method nlm -o o.exr");

  combined(folder, "--unbiased layers.exr:ViewLayer --reference layers.exr:ViewLayer --method ideal@nlm -o i.exr");
  CHECK(relativeDistance(readImage(folder.path / "i.exr").rgb(), c.pt().mean) < 1e-5);

  // A pass without a view layer.
  ForeignChannels odd;
  odd.add(".Combined", "RGB", c.pt().mean);
  writeForeign(folder.path / "odd.exr", odd);
  CHECK(identical(read("odd.exr", nullptr).estimates[0].mean, c.pt().mean));
}

TEST_CASE("Images that do not belong together are refused, naming both") {
  const Folder folder;
  const auto render = [&](const std::string& scene, const std::string& rest) {
    const Run run = braidRun(folder, "render '" BRAID_SOURCE_DIR "/scenes/" + scene +
                                         ".glb' -q --integrator pt --combine none --aovs all " + rest);
    INFO(run.err);
    REQUIRE(run.code == 0);
  };
  render("cornell", "-o a.exr --size 16x12 --spp 8");
  render("cornell", "-o same.exr --spp 4 --size 16x12");
  render("cornell", "-o b.exr --seed 1 --size 16x12 --spp 8");
  render("cornell", "-o turned.exr --seed 2 --yfov 20 --size 16x12 --spp 8");
  render("plates", "-o other.exr --seed 3 --size 16x12 --spp 8");
  render("cornell", "-o left.exr --seed 4 --size 32x12 --crop 0,0,16,12 --spp 8");
  render("cornell", "-o right.exr --seed 5 --size 32x12 --crop 16,0,32,12 --spp 8");
  const auto refused = [&](const std::string& arguments, const std::string& part, const std::string& file) {
    const Run run = combined(folder, arguments + " --method nlm -o o.exr", 2);
    CHECK(contains(run.err, part));
    CHECK(contains(run.err, file));
    CHECK_FALSE(fs::exists(folder.path / "o.exr"));
  };
  refused("--unbiased a.exr,a.exr", "same samples", "a.exr");
  refused("--unbiased a.exr,same.exr", "one seed of one scene", "same.exr");
  refused("--unbiased a.exr,turned.exr", "is seen by another camera than", "turned.exr");
  refused("--unbiased a.exr,other.exr", "is of another scene than", "other.exr");
  refused("--unbiased left.exr,right.exr", "is another part of the frame than", "right.exr");
  refused("--unbiased b.exr,a.exr,a.exr", "same samples", "a.exr");
  for (const char* role : {"--correlated", "--biased", "--reference"})
    refused("--unbiased a.exr " + std::string(role) + " other.exr", "is of another scene than", "other.exr");
  refused("--unbiased a.exr --bases nlm,turned.exr", "is seen by another camera than", "turned.exr");
  refused("--unbiased a.exr --denoiser external:other.exr", "is of another scene than", "other.exr");

  const Case c = noisyCase(16, 12);
  for (const std::string name : {"p", "copy"}) writeForeign(folder.path / (name + ".exr"), plainChannels(c));
  refused("--unbiased p.exr,copy.exr", "the halves are the same pixels", "p.exr,copy.exr");
  writeForeign(folder.path / "camera1.exr", cyclesChannels(c), 0, {{"Camera", "Camera"}});
  writeForeign(folder.path / "camera2.exr", cyclesChannels(noisyCase(16, 12, 0.5)), 0, {{"Camera", "Side"}});
  refused("--unbiased camera1.exr,camera2.exr", "has another 'Camera' in its header than", "camera1.exr");
  combined(folder, "-q --unbiased a.exr,b.exr --method nlm -o ok.exr");
  // What was made of them still says of which view it is.
  combined(folder, "-q --unbiased a.exr --bases nlm,ok.exr --method average -o ok2.exr");
  refused("--unbiased turned.exr --biased ok.exr", "is seen by another camera than", "ok.exr");
}

}  // namespace braid::test_foreign_combine
