// SPDX-License-Identifier: Apache-2.0
// References of `braid sweep`: those that show something else are refused.
#include <doctest/doctest.h>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
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
  o.spp = "2";
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
  CHECK(refusal([](SweepOptions& s) { s.size = "24x16"; }) ==
        reference +
            ": is no reference for this sweep: it has 24x24 pixels, the sweep renders 24x16; give --size 24x24 "
            "or another reference");
  CHECK(refusal([](SweepOptions& s) { s.maxDepth = 6; }).find("--max-depth 5") != std::string::npos);
  CHECK(refusal([](SweepOptions& s) { s.scenes = {test::sourcePath("scenes/plates.glb")}; }).find("camera") !=
        std::string::npos);
  CHECK(refusal([](SweepOptions& s) { s.references = {"/nonexistent.exr"}; }).find("no such reference") !=
        std::string::npos);
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
      renderReference(folder.path.string(), scene, camera, settings, test::integrators(), {}, nullptr);
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

}  // namespace braid::test_sweep_references
