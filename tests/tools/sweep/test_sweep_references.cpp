// SPDX-License-Identifier: Apache-2.0
// References of `braid sweep`: those that show something else are refused.
#include <numeric>

#include <doctest/doctest.h>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/session/rendering_revision.h"
#include "tests/support/contains.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"
#include "tools/images/estimates_file.h"
#include "tools/sweep/sweep.h"
#include "tools/sweep/sweep_reference.h"
#include "tools/sweep/table/sweep_summary.h"
#include "tests/tools/sweep/small_sweeps.h"

namespace braid::test_sweep_references {

using namespace test::small_sweeps;
using test::Folder;

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
          s.view.size = {24, 16};
        }) == reference +
                  ": is no reference for this sweep: it has 24x24 pixels, the sweep renders 24x16; give --size 24x24 "
                  "or another reference");
  CHECK(refusal([](SweepOptions& s) { s.maxDepth = 6; }).find("--max-depth 5") != std::string::npos);
  CHECK(refusal([](SweepOptions& s) { s.scenes = {test::sourcePath("scenes/plates.glb")}; }).find("camera") !=
        std::string::npos);
  CHECK(refusal([](SweepOptions& s) { s.references = {"/nonexistent.exr"}; }).find("no such reference") !=
        std::string::npos);
}

TEST_CASE("A sweep under other light has a reference of its own and is not mixed with the first one") {
  const Folder folder;
  SweepOptions o = smallSweep(folder);
  o.spp = parseLadder("2", false);
  o.seeds = 1;
  REQUIRE(sweep(o) == 0);
  SweepOptions brighter = o;
  brighter.view.lightScale = 4;
  const auto [code, reason] = failureOf([&] { sweep(brighter); });
  CHECK(code == ExitCode::Usage);
  CHECK(test::contains(reason, "--light-scale 4"));
  SweepOptions absent = o;
  absent.view.environment = "/nonexistent.hdr";
  CHECK(failureOf([&] { sweep(absent); }).second == "/nonexistent.hdr: no such environment");
  brighter.output = (folder.path / "brighter").string();
  REQUIRE(sweep(brighter) == 0);
  const auto means = [&](const SweepOptions& of) {
    const auto file = std::filesystem::directory_iterator(of.output + "/references")->path();
    const Rgb<float> mean = readImage(file.string()).rgb("pt.mean");
    return std::pair(file.filename().string(), std::accumulate(mean[1].data.begin(), mean[1].data.end(), 0.0));
  };
  const auto [nameOfFirst, first] = means(o);
  const auto [nameOfBrighter, bright] = means(brighter);
  CHECK(nameOfFirst != nameOfBrighter);
  CHECK(bright == doctest::Approx(4 * first).epsilon(1e-4));
}

TEST_CASE("A reference is of one view, of an unbiased estimate and of seeds of its own") {
  const Folder folder;
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
  // The same view from another place, and through another lens.
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

TEST_CASE("References of another rendering revision are refused, and those that a sweep kept rendered anew") {
  const Folder folder;
  const Scene scene(cornellBox());
  const CameraData camera = scene.data().cameras[0];
  Settings settings = test::settingsFor(16, 16, 2);
  settings.integrators = {"pt"};
  const ReferenceFrame frame = referenceFrame(scene, camera, settings);
  const auto render = [&] {
    return renderReference(folder.path.string(), {scene, camera, settings, test::integrators()}, {}, nullptr);
  };
  const auto rendered = render();
  REQUIRE(rendered);
  const ImageFile file = readImage(rendered->file);
  Estimates other = readEstimates(file);
  other.attributes = file.attributes;
  for (Attribute& a : other.attributes)
    if (a.name == "braid/renderingRevision") a.integer = kRenderingRevision + 1;
  ExrOptions exr;
  exr.floatHeadline = true;
  writeExr(rendered->file, other, file.rgb(""), nullptr, exr);
  const std::string revisions = fmt::format("rendered at rendering revision {}, and this braid renders at {}",
                                            kRenderingRevision + 1, kRenderingRevision);
  const std::string refusal = failureOf([&] { readReference(rendered->file, frame, "pt", 0, 1); }).second;
  CHECK(test::contains(refusal, rendered->file));
  CHECK(test::contains(refusal, revisions));
  std::string stale;
  CHECK_FALSE(keptReference(folder.path.string(), frame, "pt", 2, &stale));
  CHECK(test::contains(stale, rendered->file));
  CHECK(test::contains(stale, revisions));
  REQUIRE(render());
  stale.clear();
  CHECK(keptReference(folder.path.string(), frame, "pt", 2, &stale));
  CHECK(stale.empty());
}

}  // namespace braid::test_sweep_references
