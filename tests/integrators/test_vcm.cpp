// SPDX-License-Identifier: Apache-2.0
// Vertex connection and merging agrees with the unbiased integrators, and finds what they cannot.
#include <cmath>

#include <doctest/doctest.h>

#include "integrators/bidirectional/merge_grid.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/statistics/calibration.h"

namespace braid::test_vcm {

using namespace test;

namespace {

RenderResult renderWith(const Scene& scene, const char* integrator, Settings settings) {
  settings.integrators = {integrator};
  return render(scene, settings);
}

// The same scene with its lamps `scale` times as wide and as much dimmer.
SceneData withLargerLamps(SceneData data, float scale) {
  for (TriangleMesh& mesh : data.meshes) {
    if (!data.materials[mesh.material].emissive()) continue;
    Vec3 centre(0);
    for (const Vec3& p : mesh.positions) centre += p / static_cast<float>(mesh.positions.size());
    for (Vec3& p : mesh.positions) p = centre + (p - centre) * scale;
  }
  for (Material& m : data.materials) m.emission /= scale * scale;
  return data;
}

}  // namespace

TEST_CASE("A merge grid delivers every vertex within the radius once") {
  Rng rng(5);
  std::vector<MergeVertex> vertices(2000);
  for (MergeVertex& v : vertices) v.position = Vec3(rng.next(), rng.next(), rng.next()) * 4.0f - 2.0f;
  for (size_t i = 0; i < vertices.size(); ++i) vertices[i].segments = static_cast<int>(i);
  const MergeGrid grid(vertices, 0.3f);
  for (int q = 0; q < 200; ++q) {
    const Vec3 p = Vec3(rng.next(), rng.next(), rng.next()) * 5.0f - 2.5f;
    std::vector<int> found(vertices.size(), 0);
    grid.query(p, [&](const MergeVertex& v) { ++found[static_cast<size_t>(v.segments)]; });
    for (size_t i = 0; i < vertices.size(); ++i) {
      const Vec3 d = vertices[i].position - p;
      CHECK(found[i] == (glm::dot(d, d) <= 0.3f * 0.3f ? 1 : 0));
    }
  }
  MergeGrid({}, 1).query(Vec3(0), [](const MergeVertex&) { FAIL("an empty grid has no vertices"); });
}

TEST_CASE("vcm converges to pt on a Cornell box") {
  const Scene scene(cornellBox());
  const RenderResult vcm = renderWith(scene, "vcm", settingsFor(48, 48, 128));
  const RenderResult pt = renderWith(scene, "pt", settingsFor(48, 48, 512));
  for (size_t c = 0; c < 3; ++c) {
    const Measured a = meanOf(vcm, c), b = meanOf(pt, c);
    MESSAGE("vcm / pt ", a.value / b.value, " +- ", std::hypot(a.error, b.error) / b.value);
    // Merging blurs over a radius of two pixels: the mean may differ by the bias at edges.
    CHECK(std::fabs(a.value - b.value) < 0.005 * b.value + kSigmas * std::hypot(a.error, b.error));
  }
}

TEST_CASE("On caustics of tiny lamps bdpt agrees with vcm, and with pt once the lamps are larger") {
  for (const char* name : {"glass_of_water", "torus_glass", "pool"}) {
    const SceneData data = loadGltf(sourcePath("scenes/" + std::string(name) + ".glb"));
    CAPTURE(std::string(name));
    const Scene enlarged(withLargerLamps(data, 6));
    const RenderResult bdpt = renderWith(enlarged, "bdpt", settingsFor(32, 18, 256));
    const RenderResult pt = renderWith(enlarged, "pt", settingsFor(32, 18, 2048));
    const RenderResult vcm = renderWith(enlarged, "vcm", settingsFor(32, 18, 256));
    for (size_t c = 0; c < 3; ++c) {
      const Measured a = meanOf(bdpt, c), b = meanOf(pt, c), v = meanOf(vcm, c);
      MESSAGE(std::string(name), " enlarged: bdpt / pt ", a.value / b.value, " +- ",
              std::hypot(a.error, b.error) / b.value, ", vcm / pt ", v.value / b.value, " +- ",
              std::hypot(v.error, b.error) / b.value);
      CHECK(std::fabs(a.value - b.value) < 0.003 * b.value + kSigmas * std::hypot(a.error, b.error));
      CHECK(std::fabs(v.value - b.value) < 0.02 * b.value + kSigmas * std::hypot(v.error, b.error));
    }
  }
}

TEST_CASE("calibration: vcm's reported variance is true") {
  const Scene scene(cornellBox());
  Settings pilotSettings = clampedSettings(24, 24, 128, SamplerKind::Independent, 1000);
  Calibration calibration(renderWith(scene, "vcm", pilotSettings));
  for (uint64_t seed = 0; seed < 64; ++seed)
    calibration.add(renderWith(scene, "vcm", clampedSettings(24, 24, 16, SamplerKind::Independent, seed)));
  checkCalibration(calibration, "vcm independent", false);
}

}  // namespace braid::test_vcm
