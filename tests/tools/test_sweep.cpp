// SPDX-License-Identifier: Apache-2.0
// `braid sweep`: rows that can be resumed, references that are refused, methods that share a render, the report.
#include <cmath>
#include <fstream>
#include <iterator>
#include <sstream>

#include <doctest/doctest.h>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/film/files/exr.h"
#include "renderer/session/rendering_revision.h"
#include "tests/support/contains.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"
#include "tools/images/estimates_file.h"
#include "tools/sweep/sweep.h"
#include "tools/sweep/sweep_pipeline.h"
#include "tools/sweep/sweep_reference.h"
#include "tools/sweep/sweep_run.h"
#include "tools/sweep/table/sweep_summary.h"
#include "tools/sweep/table/sweep_table.h"

namespace braid::test_sweep {

using test::Folder;

namespace {

// 24x24 pixels of the Cornell box, independent samples, one thread's worth of work.
SweepOptions smallSweep(const Folder& folder) {
  SweepOptions o;
  o.scenes = {test::sourcePath("scenes/cornell.glb")};
  o.output = (folder.path / "sweep").string();
  o.methods = {"pt"};
  o.spp = parseLadder("4:16", false);
  o.seeds = 2;
  o.referenceSpp = 64;
  o.size = {24, 24};
  o.sampler = SamplerKind::Independent;
  o.maxDepth = 5;
  o.noPlots = true;
  o.quiet = true;
  return o;
}

std::string text(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::pair<ExitCode, std::string> failureOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& e) {
    return {e.code(), e.what()};
  }
  return {ExitCode::Ok, ""};
}

int sweep(const SweepOptions& o) {
  std::ostringstream out;
  return runSweep(o, out);
}

// A method that averages 3x3 pixels, to stand for a denoiser.
SweepMethod boxMethod() {
  SweepMethod m;
  m.name = "box3";
  m.inputs = {{"pt", 1}};
  m.finish = [](const std::shared_ptr<const Estimates>& estimates, const Rgb<float>&) {
    const Rgb<float>& in = estimates->find("pt")->mean;
    MethodImage out{Rgb<float>(in.width(), in.height()), 0.25, 0.125, "", {}};
    for (int y = 0; y < in.height(); ++y)
      for (int x = 0; x < in.width(); ++x)
        for (size_t c = 0; c < 3; ++c) {
          float sum = 0;
          for (int v = -1; v <= 1; ++v)
            for (int u = -1; u <= 1; ++u)
              sum += in[c].at(std::clamp(x + u, 0, in.width() - 1), std::clamp(y + v, 0, in.height() - 1));
          out.image[c].at(x, y) = sum / 9;
        }
    return out;
  };
  return m;
}

}  // namespace

TEST_CASE("Ladders double from rung to rung and mistakes are named") {
  CHECK(parseLadder("4:32", false) == std::vector<double>{4, 8, 16, 32});
  CHECK(parseLadder("3:20", false) == std::vector<double>{3, 6, 12});
  CHECK(parseLadder("16,4,16", false) == std::vector<double>{4, 16});
  CHECK(parseLadder("30s:2m", true) == std::vector<double>{30, 60, 120});
  CHECK(parseLadder("0.5", true) == std::vector<double>{0.5});
  for (const char* wrong : {"", "8:4", "0:4", "1:2:3", "4,x", "-4", "1.5"})
    CHECK_MESSAGE(failureOf([&] { parseLadder(wrong, false); }).first == ExitCode::Usage, wrong);
}

TEST_CASE("Scenes of one stem are told apart by their folders") {
  CHECK(sceneNames({"a/x.glb", "b/y z.glb"}) == std::vector<std::string>{"x", "y_z"});
  CHECK(sceneNames({"a/scene.gltf", "b/scene.gltf"}) == std::vector<std::string>{"a-scene", "b-scene"});
  CHECK(failureOf([] { sceneNames({"a/s.gltf", "b/a/s.glb"}); }).first == ExitCode::Usage);
  CHECK(valueForScene({"pt", "pool=bdpt"}, "pool", "x") == "bdpt");
  CHECK(valueForScene({"pool=bdpt", "pt"}, "room", "x") == "pt");
  CHECK(valueForScene({"pool=bdpt"}, "room", "x") == "x");
}

TEST_CASE("A sweep has one row a cell, and deleted rows come back with the same values") {
  const Folder folder;
  SweepOptions o = smallSweep(folder);
  const std::vector<SweepMethod> methods{integratorMethods(test::integrators()).front(), boxMethod()};
  std::ostringstream out;
  REQUIRE(runSweep(o, methods, test::integrators(), out) == 0);
  const std::string csv = o.output + "/sweep.csv";
  const SweepTable all = readSweepTable(csv);
  REQUIRE(all.rows.size() == 2 * 3 * 2);  // methods x rungs x seeds
  for (const SweepRow& r : all.rows) {
    CHECK(r.spp == static_cast<uint64_t>(r.mark));
    CHECK(r.render > 0);
    const bool box = r.method == "box3";
    CHECK(r.denoise == (box ? 0.25 : 0.0));
    CHECK(r.combine == (box ? 0.125 : 0.0));
    for (size_t i = 0; i < all.columns.size(); ++i) {
      const bool ofInput = all.columns[i] == "better_pixels" || all.columns[i] == "squared_difference";
      const bool unsaid = all.columns[i] == "estimated_error" && (box || r.spp < 2);
      CHECK_MESSAGE(std::isnan(r.values[i]) == (unsaid || (ofInput && !box)), r.method, " ", all.columns[i]);
    }
  }
  // Rows 0 to 5 are pt's, 6 to 11 those of box3 at the same rungs and seeds: the mean difference of squared errors is
  // the difference of the mean squared errors.
  const size_t mse = all.column("MSE"), difference = all.column("squared_difference");
  for (size_t i = 0; i < 6; ++i) {
    const SweepRow &pt = all.rows[i], &box = all.rows[i + 6];
    CHECK(box.values[difference] == doctest::Approx(box.values[mse] - pt.values[mse]).epsilon(1e-9));
    CHECK(box.values[all.column("better_pixels")] > 0);
    CHECK(box.values[all.column("better_pixels")] < 1);
  }
  CHECK(out.str().find("| cornell | box3 |") != std::string::npos);

  // Every second row goes, and the last line of an interrupted run is half written.
  SweepTable half = all;
  half.rows.clear();
  for (size_t i = 0; i < all.rows.size(); i += 2) half.rows.push_back(all.rows[i]);
  writeSweepTable(csv, half);
  std::ofstream(csv, std::ios::app | std::ios::binary) << "cornell,pt,spp,8,8,1,0.0";
  const auto reference = std::filesystem::directory_iterator(o.output + "/references")->path();
  const auto rendered = std::filesystem::last_write_time(reference);
  REQUIRE(runSweep(o, methods, test::integrators(), out) == 0);
  CHECK(std::filesystem::last_write_time(reference) == rendered);
  const SweepTable again = readSweepTable(csv);
  REQUIRE(again.rows.size() == all.rows.size());
  for (size_t i = 0; i < all.rows.size(); ++i) {
    CHECK(sameCell(again.rows[i], all.rows[i]));
    CHECK(again.rows[i].spp == all.rows[i].spp);
    for (size_t v = 0; v < all.columns.size(); ++v) {
      const double a = all.rows[i].values[v], b = again.rows[i].values[v];
      CHECK((a == b || (std::isnan(a) && std::isnan(b))));
    }
  }
  // Nothing left to do: the rows, times included, stay as they are.
  const std::string before = text(csv);
  REQUIRE(runSweep(o, methods, test::integrators(), out) == 0);
  CHECK(text(csv) == before);
}

TEST_CASE("A table that is read and written again keeps its bytes") {
  const Folder folder;
  const std::string csv = (folder.path / "sweep.csv").string();
  SweepTable table;
  for (uint64_t seed = 0; seed < 2000; ++seed) {
    SweepRow row;
    row.scene = "cornell";
    row.method = "pt";
    row.seed = seed;
    const auto random = [&](uint64_t k) { return static_cast<double>(hashCombine(seed, k) >> 11) * 0x1p-53; };
    row.render = random(0);
    row.denoise = 0.01 * random(1);
    row.combine = 10 * random(2);
    table.rows.push_back(row);
  }
  writeSweepTable(csv, table);
  const std::string before = text(csv);
  writeSweepTable(csv, readSweepTable(csv));
  CHECK(text(csv) == before);
}

TEST_CASE("A sweep may grow, but rows of other options are refused") {
  const Folder folder;
  SweepOptions o = smallSweep(folder);
  o.spp = parseLadder("2", false);
  o.seeds = 1;
  REQUIRE(sweep(o) == 0);
  SweepOptions more = o;
  more.spp = parseLadder("2:4", false);
  more.seeds = 2;
  REQUIRE(sweep(more) == 0);
  CHECK(readSweepTable(o.output + "/sweep.csv").rows.size() == 4);

  SweepOptions other = o;
  other.maxDepth = 6;
  const auto [code, reason] = failureOf([&] { sweep(other); });
  CHECK(code == ExitCode::Usage);
  CHECK(reason == o.output +
                      "/sweep.json: the sweep in this folder was made with maxDepth 5, not 6: its rows cannot be "
                      "compared with new ones; give the same options or another folder (-o)");
  other = o;
  other.sampler = "sobol";
  CHECK(failureOf([&] { sweep(other); }).first == ExitCode::Usage);
  other = o;
  other.metrics = {"MSE"};
  CHECK(failureOf([&] { sweep(other); }).first == ExitCode::Usage);
  // A better reference changes every error.
  other = more;
  other.spp = parseLadder("8", false);
  other.referenceSpp = 128;
  CHECK(failureOf([&] { sweep(other); }).second.find("another reference of the scene cornell") != std::string::npos);
  std::filesystem::remove(o.output + "/sweep.json");
  CHECK(failureOf([&] { sweep(o); }).first == ExitCode::Usage);
  CHECK(readSweepTable(o.output + "/sweep.csv").rows.size() == 4);
}

TEST_CASE("The ladder of seconds records the true seconds and samples past each mark") {
  const Folder folder;
  SweepOptions o = smallSweep(folder);
  o.spp.clear();
  o.time = parseLadder("0.02:0.08", true);
  o.seeds = 1;
  REQUIRE(sweep(o) == 0);
  const SweepTable t = readSweepTable(o.output + "/sweep.csv");
  REQUIRE(t.rows.size() == 3);
  for (size_t i = 0; i < t.rows.size(); ++i) {
    CHECK((t.rows[i].ladder == Ladder::Time));
    // The clock of the ladder also counts what lies between passes, which on a busy machine may be any time: so rows
    // are not held against their marks, but they tell what was measured, not the mark.
    CHECK(t.rows[i].render > 0);
    CHECK(t.rows[i].render != t.rows[i].mark);
    CHECK(t.rows[i].spp >= 1);
    if (i == 0) continue;
    CHECK(t.rows[i].mark == doctest::Approx(2 * t.rows[i - 1].mark));
    CHECK(t.rows[i].spp >= t.rows[i - 1].spp);
    CHECK(t.rows[i].render >= t.rows[i - 1].render);
  }
}

TEST_CASE("References that show something else are refused with a sentence") {
  const Folder folder;
  SweepOptions o = smallSweep(folder);
  o.spp = parseLadder("2", false);
  o.seeds = 1;
  REQUIRE(sweep(o) == 0);
  const std::string reference = std::filesystem::directory_iterator(o.output + "/references")->path().string();
  CHECK(readImage(reference).planes.count("pt.halfA.R") == 1);
  SweepOptions given = o;
  given.output = (folder.path / "given").string();
  given.references = {reference};
  REQUIRE(sweep(given) == 0);
  const auto refusal = [&](const std::function<void(SweepOptions&)>& change) {
    SweepOptions other = given;
    other.output = (folder.path / "other").string();
    change(other);
    const auto [code, reason] = failureOf([&] { sweep(other); });
    CHECK(code == ExitCode::BadInput);
    return reason;
  };
  CHECK(refusal([](SweepOptions& s) {
          s.size = {24, 16};
        }) == reference +
                  ": is no reference for this sweep: it has 24x24 pixels, the sweep renders 24x16; give --size 24x24 "
                  "or another reference");
  CHECK(refusal([](SweepOptions& s) { s.maxDepth = 6; }).find("--max-depth 5") != std::string::npos);
  CHECK(refusal([](SweepOptions& s) { s.scenes = {test::sourcePath("scenes/plates.glb")}; }).find("camera") !=
        std::string::npos);
  CHECK(refusal([](SweepOptions& s) { s.references = {"/nonexistent.exr"}; }).find("no such reference") !=
        std::string::npos);

  // The same view from another place, and a run's own seed.
  SceneData data = cornellBox();
  data.contentHash = 1;
  const Scene scene(std::move(data));
  CameraData camera = scene.data().cameras[0];
  Settings settings = test::settingsFor(16, 16, 2);
  settings.integrators = {"pt"};
  const ReferenceFrame frame = referenceFrame(scene, camera, settings);
  const auto rendered =
      renderReference(folder.path.string(), {scene, camera, settings, test::integrators()}, {}, nullptr);
  REQUIRE(rendered);
  CHECK(readReference(rendered->file, frame, "pt", 0, 1).contentHash == rendered->contentHash);
  CHECK(failureOf([&] { readReference(rendered->file, frame, "pt", kReferenceSeed, 1); }).second.find("seed") !=
        std::string::npos);
  CHECK(rendered->passedOver.empty());
  // Other pixels than this braid makes: a given one is refused, a kept one rendered anew.
  ImageFile older = readImage(rendered->file);
  Estimates stale = readEstimates(older);
  stale.attributes = older.attributes;
  for (Attribute& a : stale.attributes)
    if (a.name == "braid/renderingRevision") a.integer = kRenderingRevision + 1;
  const std::string keptPath = rendered->file, otherPath = folder.path / "other_revision.exr";
  ExrOptions halves;
  halves.floatHeadline = true;
  writeExr(otherPath, stale, older.rgb(""), nullptr, halves);
  const std::string revisions =
      fmt::format("rendering revision {}, and this braid renders at {}", kRenderingRevision + 1, kRenderingRevision);
  CHECK(test::contains(failureOf([&] { readReference(otherPath, frame, "pt", 0, 1); }).second, revisions));
  std::filesystem::rename(otherPath, keptPath);
  std::string reason;
  CHECK_FALSE(keptReference(folder.path.string(), frame, "pt", 2, &reason));
  CHECK(test::contains(reason, revisions));
  REQUIRE(renderReference(folder.path.string(), {scene, camera, settings, test::integrators()}, {}, nullptr));
  reason.clear();
  CHECK(keptReference(folder.path.string(), frame, "pt", 2, &reason));
  CHECK(reason.empty());
  // A file that shows a combined image first: its unbiased estimate is the reference, for that has independent halves.
  const ImageFile file = readImage(rendered->file);
  Estimates combined = readEstimates(file);
  combined.attributes = file.attributes;
  combined.attributes.push_back({"braid/headline", Attribute::Kind::String, "combined.auto", 0, 0, {}});
  const std::string combinedPath = folder.path / "combined.exr";
  ExrOptions exr;
  exr.floatHeadline = true;
  writeExr(combinedPath, combined, Rgb<float>(16, 16, 1.0f), nullptr, exr);
  const SweepReference chosen = readReference(combinedPath, frame, "pt", 0, 1);
  CHECK(chosen.passedOver == "combined.auto");
  CHECK(chosen.contentHash == rendered->contentHash);
  camera.toWorld[3].x += 0.01f;
  const ReferenceFrame moved = referenceFrame(scene, camera, settings);
  CHECK(referenceName(moved) != referenceName(frame));
  CHECK(failureOf([&] { readReference(rendered->file, moved, "pt", 0, 1); }).second.find("another camera") !=
        std::string::npos);
  camera = scene.data().cameras[0];
  camera.yfov *= 1.01f;
  CHECK(failureOf([&] {
          readReference(rendered->file, referenceFrame(scene, camera, settings), "pt", 0, 1);
        }).second.find("another camera") != std::string::npos);
  // More samples than the kept one has, or another integrator: rendered anew, not refused.
  CHECK(keptReference(folder.path.string(), frame, "pt", 2));
  CHECK_FALSE(keptReference(folder.path.string(), frame, "pt", 4));
  CHECK_FALSE(keptReference(folder.path.string(), frame, "other", 2));
}

TEST_CASE("Squared error of path tracing falls as one over the samples") {
  const Folder folder;
  SweepOptions o = smallSweep(folder);
  // Inside the furnace no pixel is much noisier than another, so a few samples tell the slope.
  o.scenes = {test::sourcePath("scenes/furnace.glb")};
  o.maxDepth = 8;
  o.metrics = {"relL2"};
  o.spp = parseLadder("4:64", false);
  o.seeds = 4;
  o.referenceSpp = 128;
  REQUIRE(sweep(o) == 0);
  const SweepTable t = readSweepTable(o.output + "/sweep.csv");
  const Curve curve = curveOf(t, "furnace", "pt", Ladder::Samples, t.column("relL2_unbiased"));
  REQUIRE(curve.size() == 5);
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const LadderPoint& p : curve) {
    const double x = std::log(p.spp), y = std::log(p.error);
    sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  const double n = static_cast<double>(curve.size()), slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  // Over 16 groups of seeds the slope was -0.999 with a standard deviation of 0.024. The tolerance is 5 of them: a
  // false alarm in about 10⁴ choices of seeds, as the deviation itself is known to 20 % only.
  CHECK_MESSAGE(std::fabs(slope + 1) < 0.12, slope);
}

TEST_CASE("Methods share a render where they share an integrator, and only there") {
  SweepMethod pt, bdpt, sppm, both, denoised, unequal;
  pt.inputs = {{"pt", 1}};
  bdpt.inputs = {{"bdpt", 1}};
  sppm.inputs = {{"sppm", 1}};
  both.inputs = {{"pt", 1}, {"sppm", 1}};
  denoised.inputs = {{"bdpt", 1}};
  unequal.inputs = {{"pt", 2}, {"sppm", 1}};
  const std::vector<SweepMethod> methods{pt, bdpt, sppm, both, denoised, unequal};
  using Groups = std::vector<std::vector<size_t>>;
  CHECK(groupMethods(methods, false) == Groups{{0, 2, 3}, {1, 4}, {5}});
  CHECK(groupMethods(methods, true) == Groups{{0}, {1, 4}, {2}, {3}, {5}});
}

TEST_CASE("Methods read the features of their own first integrator, whatever else is measured") {
  SweepMethod pt, bdpt, sppm, filter, mixed, other, vcm;
  pt.inputs = filter.inputs = {{"pt", 1}};
  bdpt.inputs = {{"bdpt", 1}};
  sppm.inputs = {{"sppm", 1}};
  mixed.inputs = {{"pt", 1}, {"sppm", 1}};
  other.inputs = {{"bdpt", 1}, {"sppm", 1}};
  vcm.inputs = {{"vcm", 1}};
  filter.buffers.features = mixed.buffers.features = other.buffers.features = true;
  using Groups = std::vector<std::vector<size_t>>;
  CHECK(groupMethods({sppm, bdpt, pt, filter, mixed, other, vcm}, false) == Groups{{0, 2, 3, 4}, {1, 5}, {6}});
  // One that joins two of them without features makes no one of them.
  SweepMethod both;
  both.inputs = {{"pt", 1}, {"bdpt", 1}};
  CHECK(groupMethods({pt, bdpt, both, filter, other}, false) == Groups{{0, 1, 2, 3}, {4}});
  // Of the methods of a job, one that reads features is asked first.
  SweepJob job;
  job.cells = {{&sppm, 8}, {&mixed, 8}};
  CHECK(job.inputs() == mixed.inputs);
}

TEST_CASE("The report is one file: plots and pictures are inside") {
  const Folder folder;
  SweepOptions o = smallSweep(folder);
  o.noPlots = false;
  const std::vector<SweepMethod> methods{integratorMethods(test::integrators()).front(), boxMethod()};
  std::ostringstream out;
  REQUIRE(runSweep(o, methods, test::integrators(), out) == 0);
  const std::string html = text(o.output + "/report.html");
  size_t pictures = 0;
  for (const char* attribute : {"src=\"", "href=\""})
    for (size_t at = html.find(attribute); at != std::string::npos; at = html.find(attribute, at + 1)) {
      CHECK(html.compare(at + std::string(attribute).size(), 5, "data:") == 0);
      ++pictures;
    }
  // Slider 3, crops 3, their errors 2, maps 2, scale 1, and the plots where gnuplot is installed.
  CHECK(pictures >= 11);
  CHECK(html.find("http://") == std::string::npos);
  CHECK(html.find("https://") == std::string::npos);
  CHECK(html.find("url(") == std::string::npos);
  for (const char* name : {"cornell-spp", "cornell-seconds"}) {
    const std::string script = text(o.output + "/plots/" + name + ".gp");
    CHECK(script.find("slope -1") != std::string::npos);
    CHECK(script.find("filledcurves") != std::string::npos);
    CHECK(text(o.output + "/plots/" + name + ".dat").find("# box3") != std::string::npos);
    if (std::system("command -v gnuplot >/dev/null") == 0) {
      CHECK(text(o.output + "/plots/" + name + ".svg").find("</svg>") != std::string::npos);
      CHECK(text(o.output + "/plots/" + name + ".png").substr(1, 3) == "PNG");
    }
  }
  const auto record = test::Json::parse(text(o.output + "/sweep.json"));
  CHECK(record["schema"] == 1);
  CHECK(record["settings"]["maxDepth"] == 5);
  CHECK(record["scenes"][0]["reference"]["spp"] == 64);
  CHECK(!record["machine"]["processor"].get<std::string>().empty());
  CHECK(text(o.output + "/summary.md").find("| cornell | box3 |") != std::string::npos);
}

TEST_CASE("Names of methods are integrators, or denoisers and combiners with the integrators that they read") {
  const auto inputs = [](const std::string& name) {
    std::vector<std::string> list;
    const std::vector<SweepMethod> methods = sweepMethods({name}, test::integrators());
    for (const MethodShare& share : methods.at(0).inputs) list.push_back(share.integrator);
    return list;
  };
  using Names = std::vector<std::string>;
  CHECK(inputs("pt") == Names{"pt"});
  CHECK(inputs("box") == Names{"pt"});
  CHECK(inputs("bdpt+sppm/auto") == Names{"bdpt", "sppm"});
  // By default the plain image, and what a render makes of the scene when nothing is said.
  CHECK(SweepOptions().methods == Names{"pt", "auto/auto"});
  const std::vector<SweepMethod> planned = sweepMethods({"auto/auto"}, test::integrators(), {}, "pt+sppm");
  CHECK(planned.at(0).name == "auto/auto");
  CHECK(planned.at(0).inputs == std::vector<MethodShare>{{"pt", 1}, {"sppm", 1}});
  for (const Integrator* i : test::integrators()) {
    const std::string name = i->name();
    if (name == "pt") continue;
    CHECK(inputs(name) == Names{name});
    if (i->unbiased() && i->correlation() == Correlation::Independent) CHECK(inputs(name + "/box") == Names{name});
  }
  const auto [code, reason] = failureOf([] { sweepMethods({"pt", "nothing"}, test::integrators()); });
  CHECK(code == ExitCode::Usage);
  CHECK(reason.find("'nothing'") != std::string::npos);
  CHECK(reason.find("integrators are pt") != std::string::npos);
}

TEST_CASE("Denoisers and combiners are measured on the render that pt is measured on") {
  const Folder folder;
  SweepOptions o = smallSweep(folder);
  o.methods = {"pt", "box"};
  o.seeds = 1;
  o.spp = parseLadder("4,8", false);
  REQUIRE(sweep(o) == 0);
  const SweepTable t = readSweepTable(o.output + "/sweep.csv");
  REQUIRE(t.rows.size() == 4);
  for (size_t i = 0; i < 2; ++i) {
    const SweepRow &pt = t.rows[i], &box = t.rows[i + 2];
    REQUIRE(box.method == "box");
    CHECK(box.render == pt.render);
    CHECK(box.denoise > 0);
    CHECK(box.combine == 0);
    CHECK(box.spp == pt.spp);
    CHECK(box.values[0] != pt.values[0]);
  }
}

}  // namespace braid::test_sweep
