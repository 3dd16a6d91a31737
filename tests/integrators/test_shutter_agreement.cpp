// SPDX-License-Identifier: Apache-2.0
// Motion blur: all integrators on one scene of which everything moves, and stills of it.
#include <doctest/doctest.h>

#include "tests/support/moving_scenes.h"
#include "tests/support/statistics/seed_means.h"

namespace braid::test_shutter_agreement {

using namespace test;

namespace {

// A box with a lens, of which a sphere, the lamp, a point light and the camera move, at `times` of the shutter: all of
// them, or one alone.
SceneData movingBox() {
  SceneData data = cornellBox();
  TriangleMesh sphere;
  addSphere(sphere, {-0.35f, 0.1f, 0.6f}, 0.25f, 2);
  Material red = data.materials[0];
  red.baseColor = Spectrum(0.8f, 0.2f, 0.1f);
  data.materials.push_back(red);
  data.motion = evenMotion(2);
  addMoving(data, std::move(sphere), static_cast<uint32_t>(data.materials.size() - 1),
            {Vec3(0), Vec3(0.4f, 0.1f, 0), Vec3(0.6f, 0.3f, -0.2f)}, Moved::ByVertices);
  // The lamp sinks, and grows.
  TriangleMesh& lamp = data.meshes[4];
  for (const float k : {1.0f, 2.0f}) {
    MeshVertices step = lamp;
    for (Vec3& p : step.positions) p = Vec3(p.x * (1 - 0.3f * k), p.y - 0.15f * k, p.z);
    lamp.steps.push_back(std::move(step));
  }
  // A second, small one turns.
  TriangleMesh small;
  addQuad(small, {-0.1f, 0, -0.1f}, {0.2f, 0, 0}, {0, 0, 0.2f});
  addMesh(data, std::move(small), 3);
  const Mat4 at = glm::translate(Mat4(1), Vec3(0.6f, 0.3f, 0));
  MeshInstance& turning = data.instances.back();
  turning.toWorld = at;
  for (const float angle : {0.5f, 1.2f}) turning.steps.push_back(glm::rotate(at, angle, Vec3(0, 0, 1)));
  PunctualLight light;
  light.kind = PunctualKind::Spot;
  light.outerConeAngle = 0.9f;
  light.intensity = Spectrum(1.5f);
  light.position = {-0.7f, 0.7f, 0.8f};
  light.direction = {0, -1, 0};
  light.steps = {{{-0.3f, 0.7f, 0.8f}, glm::normalize(Vec3(0.4f, -1, 0))},
                 {{0.3f, 0.6f, 0.8f}, glm::normalize(Vec3(0, -1, -0.5f))}};
  data.lights.push_back(light);
  CameraData& camera = data.cameras[0];
  camera.steps = {glm::translate(camera.toWorld, Vec3(0.1f, 0, -0.1f)),
                  glm::rotate(glm::translate(camera.toWorld, Vec3(0.2f, 0.1f, -0.1f)), 0.06f, Vec3(0, 1, 0))};
  camera.lensRadius = 0.05f;
  camera.focusDistance = 3.5f;
  return data;
}

SceneData stoppedBox() {
  SceneData data = movingBox();
  for (TriangleMesh& mesh : data.meshes) mesh.steps.clear();
  for (MeshInstance& instance : data.instances) instance.steps.clear();
  data.lights[0].steps.clear();
  data.cameras[0].steps.clear();
  data.motion = {};
  return data;
}

constexpr int kSeeds = 16, kBlock = 6, kSide = 36;

const SeedMeans kMeans{kSide, kBlock, kSeeds};

// Where the moving scene is at a time.
SceneData stillAt(float time) {
  SceneData data = movingBox();
  for (TriangleMesh& mesh : data.meshes) {
    if (!mesh.moves()) continue;
    const Moment m = momentAt(time, 2);
    const MeshVertices a = mesh.step(m.first), b = mesh.step(m.first + 1);
    for (size_t i = 0; i < a.positions.size(); ++i)
      mesh.positions[i] = between(a.positions[i], b.positions[i], m.fraction);
    for (size_t i = 0; i < a.normals.size(); ++i) mesh.normals[i] = between(a.normals[i], b.normals[i], m.fraction);
    mesh.steps.clear();
  }
  for (MeshInstance& i : data.instances) {
    if (i.steps.empty()) continue;
    i.toWorld = time < 0.5f ? between(i.toWorld, i.steps[0], 2 * time) : between(i.steps[0], i.steps[1], 2 * time - 1);
    i.steps.clear();
  }
  const LightPlace place = placeAt(data.lights[0], time);
  data.lights[0].position = place.position;
  data.lights[0].direction = place.direction;
  data.lights[0].steps.clear();
  CameraData& camera = data.cameras[0];
  const Camera at = Camera(camera, kSide, kSide).at(time);
  camera.toWorld = glm::inverse(at.worldToCamera());
  camera.steps.clear();
  data.motion = {};
  return data;
}

}  // namespace

// Student's t of 15 degrees of freedom and more exceeds 7 once in 200,000: over 36 blocks and 5 integrators a false
// alarm in 1,000 choices of seeds. Photons and merging blur: 2 % are forgiven there.
TEST_CASE("Shutter: all integrators see the same box, of which everything moves") {
  const Scene scene(movingBox()), stopped(stoppedBox());
  CHECK(scene.moves());
  const std::vector<Measured> pt = blockMeans(kMeans, scene, "pt", 32, 1000);
  CHECK(worst(blockMeans(kMeans, stopped, "pt", 32, 2000), pt, 0) > 20);
  const std::tuple<const char*, uint64_t, double> others[] = {
      {"bdpt", 16, 0.0}, {"crn", 32, 0.0}, {"gdpt", 16, 0.0}, {"vcm", 16, 0.02}, {"sppm", 32, 0.02}};
  for (const auto& [name, spp, bias] : others) {
    const double z = worst(blockMeans(kMeans, scene, name, spp, 1), pt, bias);
    MESSAGE(std::string(name), ": largest difference from pt ", z, " standard errors");
    CHECK(z < 7);
  }
}

TEST_CASE("Shutter: the mean of stills at even times is the picture of the open shutter") {
  const Scene scene(movingBox());
  const std::vector<Measured> blurred = blockMeans(kMeans, scene, "pt", 32, 5000);
  // A time at random within each of 32 parts, anew for each of the seeds.
  constexpr int kStills = 32;
  std::vector<double> sum(36), squares(36);
  Rng rng(11);
  for (uint64_t k = 0; k < kSeeds; ++k) {
    std::vector<double> mean(36);
    for (int i = 0; i < kStills; ++i) {
      const Scene still(stillAt((static_cast<float>(i) + rng.next()) / kStills));
      Settings settings = settingsFor(kSide, kSide, 4);
      settings.seed = 100 * k + static_cast<uint64_t>(i);
      const RenderResult r = render(still, settings);
      const std::vector<PixelWindow> blocks = blocksOf(r, kBlock);
      for (size_t b = 0; b < blocks.size(); ++b) mean[b] += meanOver(r, 1, blocks[b]).value / kStills;
    }
    for (size_t b = 0; b < mean.size(); ++b) {
      sum[b] += mean[b] / kSeeds;
      squares[b] += sqr(mean[b]) / kSeeds;
    }
  }
  std::vector<Measured> stills;
  for (size_t b = 0; b < sum.size(); ++b)
    stills.push_back({sum[b], std::sqrt(std::max(0.0, squares[b] - sqr(sum[b])) / (kSeeds - 1))});
  const double z = worst(stills, blurred, 0);
  MESSAGE("largest difference ", z, " standard errors");
  CHECK(z < 7);
}

}  // namespace braid::test_shutter_agreement
