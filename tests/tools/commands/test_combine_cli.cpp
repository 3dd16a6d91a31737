// SPDX-License-Identifier: Apache-2.0
// Combining on the command line: in `braid render` and in `braid combine`.
#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "renderer/film/files/exr.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/command_line.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"
#include "tests/tools/commands/combine_files.h"

namespace braid::test_combine_cli {

namespace fs = std::filesystem;
using namespace test::combine_files;
using test::braidRun;
using test::contains;
using test::Folder;
using test::identical;
using test::Run;

namespace {

Run rendered(const Folder& folder, const std::string& rest) {
  const Run run = braidRun(
      folder, "render '" BRAID_SOURCE_DIR "/scenes/cornell.glb' -q --size 32x24 --spp 8 " + test::plainly(rest));
  INFO(run.err);
  REQUIRE(run.code == 0);
  return run;
}

const Attribute* attribute(const ImageFile& file, const std::string& name) {
  for (const Attribute& a : file.attributes)
    if (a.name == name) return &a;
  return nullptr;
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

TEST_CASE("An image alone is combined by auto") {
  const Folder folder;
  rendered(folder, "--float -o noisy.exr");
  combined(folder, "noisy.exr -o a.exr");
  combined(folder, "--unbiased noisy.exr --method auto -o b.exr");
  CHECK(identical(readImage(folder.path / "a.exr").rgb(), readImage(folder.path / "b.exr").rgb("combined.auto")));
  for (const char* wrong : {"-o c.exr", "noisy.exr --unbiased noisy.exr -o c.exr", "noisy.exr --method none -o c.exr"})
    CHECK(braidRun(folder, std::string("combine ") + wrong).code == 1);
  CHECK_FALSE(fs::exists(folder.path / "c.exr"));
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
  refused("combine --method box -o o.exr", 1, "name the image: braid combine FILE");
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
  const std::string options = "render '" BRAID_SOURCE_DIR "/scenes/cornell.glb' -q --size 48x27 --spp 16 --float ";
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

TEST_CASE(
    "bench compares error x time of variants of a render with the first, and names a variant that it cannot read") {
  const Folder folder;
  const std::string bench =
      "bench builtin:cornell --size 48x32 --spp 4 --repeats 1 --reference-spp 64 --json "
      "--references " +
      (folder.path / "kept").string();
  const Run run = braidRun(folder, bench +
                                       " --efficiency='--integrator pt' --efficiency='--integrator pt --spp 16' "
                                       "--efficiency='--combine auto'");
  INFO(run.err);
  REQUIRE(run.code == 0);
  const nlohmann::json variants = nlohmann::json::parse(run.out)["efficiency"][0]["variants"];
  REQUIRE(variants.size() == 3);
  const auto error = [&](size_t v) { return variants[v]["relL2"].get<double>(); };
  const auto seconds = [&](size_t v) { return variants[v]["processorSeconds"].get<double>(); };
  CHECK(variants[0]["ratio"] == 1);
  CHECK(error(1) < 0.5 * error(0));
  CHECK(error(2) < 0.5 * error(0));
  for (size_t v = 0; v < 3; ++v)
    CHECK(variants[v]["ratio"].get<double>() ==
          doctest::Approx(error(v) * seconds(v) / (error(0) * seconds(0))).epsilon(1e-6));
  CHECK(!fs::is_empty(folder.path / "kept"));
  const Run wrong = braidRun(folder, bench + " --efficiency='--integratr pt'");
  CHECK(wrong.code == 1);
  CHECK(contains(wrong.err, "--integratr"));
}

}  // namespace braid::test_combine_cli
