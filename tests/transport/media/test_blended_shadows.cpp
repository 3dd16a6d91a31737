// SPDX-License-Identifier: Apache-2.0
// Alpha-blended surfaces take their exact share of the light between two points, whatever finds them.
#include <array>
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "renderer/scene/crossed_surfaces.h"
#include "renderer/transport/visibility.h"
#include "tests/transport/media/panes.h"

namespace braid::test_blended_shadows {

using namespace test;
using namespace test::panes;

namespace {

Material veil(float alpha) {
  Material m = diffuseMaterial(Spectrum(0.5f));
  m.alphaMode = AlphaMode::Blend;
  m.alpha = alpha;
  return m;
}

void addVeil(SceneData& data, float z, uint32_t material, float size = 2) {
  TriangleMesh mesh;
  addQuad(mesh, {-1, -1, z}, {size, 0, 0}, {0, size, 0});
  addMesh(data, std::move(mesh), material);
}

SceneData emptyScene() {
  SceneData data;
  data.cameras.push_back(CameraData{});
  data.environment = EnvironmentData{nullptr, Spectrum(1), 0};
  return data;
}

struct Seen {
  bool hidden;
  float passing;
};

std::vector<Seen> see(const Scene& scene, const std::vector<RayQuery>& queries) {
  const TransportContext context(scene);
  VisibilityBatch rays(context);
  int count = 0;
  for (const RayQuery& q : queries) rays.set(count++, q, 1);
  rays.trace(count);
  std::vector<Seen> list;
  for (int k = 0; k < count; ++k) {
    Spectrum value(1);
    rays.attenuate(k, value);
    list.push_back({rays.hidden(k), value.x});
  }
  return list;
}

}  // namespace

TEST_CASE("A ray takes the share of every veil between its ends, also of two in one place, whatever its salt") {
  SceneData data = emptyScene();
  data.materials = {veil(0.25f), veil(0.5f), veil(1), veil(0)};
  addVeil(data, 1, 0);
  addVeil(data, 2, 1);
  addVeil(data, 2, 0);
  addVeil(data, 3, 3);
  addVeil(data, 4, 2, 1);  // a wall over a quarter
  const Scene scene(std::move(data));
  const Vec3 up(0, 0, 1), clear(0.5f, 0.3f, 0), walled(-0.5f, -0.6f, 0);
  constexpr float kAll = 0.75f * 0.5f * 0.75f;
  for (uint32_t salt = 0; salt < 200; salt += 2) {
    const std::vector<Seen> seen = see(scene, {{clear, up, kInfinity, salt},
                                               {clear, up, 1.5f, salt},
                                               {clear, up, 0.5f, salt},
                                               {walled, up, 3.5f, salt},
                                               {walled, up, kInfinity, salt},
                                               {clear + up * 5.0f, -up, kInfinity, salt},
                                               {clear + up * 5.0f, -up * 10.0f, 0.35f, salt},
                                               {clear, up, kInfinity, salt + 10},
                                               {clear, up, 2.5f, salt}});
    const std::array<float, 9> passing{kAll, 0.75f, 1, kAll, 0, kAll, 0.75f * 0.5f, kAll, kAll};
    for (size_t k = 0; k < passing.size(); ++k) {
      CAPTURE(k);
      CHECK(seen[k].hidden == (k == 4));
      if (k != 4) CHECK(seen[k].passing == doctest::Approx(passing[k]).epsilon(1e-6));
    }
    CHECK(seen[0].passing == seen[7].passing);
  }
}

TEST_CASE("Veils before, between and behind panes take their share, and so does what a veil covers as a pane") {
  SceneData data = emptyScene();
  data.materials = {veil(0.25f), pane({0.5f, 1, 1}), pane(Spectrum(1)), diffuseMaterial(Spectrum(0.5f))};
  data.materials[2].alphaMode = AlphaMode::Blend;
  data.materials[2].alpha = 0.3f;
  addVeil(data, 1, 0);
  addVeil(data, 2, 1);
  addVeil(data, 3, 0);
  addVeil(data, 3, 0);
  addVeil(data, 4, 2);
  addVeil(data, 5, 0);
  addVeil(data, 6, 3, 1);  // a wall over a quarter, and a veil behind it
  addVeil(data, 7, 0);
  const Scene scene(std::move(data));
  CHECK(scene.traits().has(kTraitPanes));
  const Vec3 up(0, 0, 1), clear(0.5f, 0.3f, 0), walled(-0.5f, -0.6f, 0);
  const float kPane = 0.5f * 0.96f, kVeiledPane = 0.7f + 0.3f * 0.96f,
              kToWall = std::pow(0.75f, 4.0f) * kPane * kVeiledPane;
  for (uint32_t salt = 0; salt < 200; salt += 2) {
    const std::vector<Seen> seen = see(scene, {{clear, up, kInfinity, salt},
                                               {clear + up * 9.0f, -up, kInfinity, salt},
                                               {clear, up * 3.5f, 1, salt},
                                               {clear, up, 2.5f, salt},
                                               {walled, up, 5.5f, salt},
                                               {walled, up, kInfinity, salt}});
    const std::array<float, 6> passing{0.75f * kToWall, 0.75f * kToWall, std::pow(0.75f, 3.0f) * kPane,
                                       0.75f * kPane,   kToWall,         0};
    for (size_t k = 0; k < passing.size(); ++k) {
      CAPTURE(k);
      CHECK(seen[k].hidden == (k == 5));
      if (k != 5) CHECK(seen[k].passing == doctest::Approx(passing[k]).epsilon(1e-5));
    }
  }
}

TEST_CASE("A lone ray and rays in packets take the same share, to the bit") {
  SceneData data = emptyScene();
  for (int k = 0; k < 30; ++k) {
    data.materials.push_back(veil(0.03f * static_cast<float>(k + 1)));
    addVeil(data, 1 + 0.1f * static_cast<float>(k), static_cast<uint32_t>(k));
  }
  const Scene scene(std::move(data));
  const RayQuery ray{{0.2f, 0.1f, 0}, {0.01f, 0.02f, 1}, kInfinity, 2};
  const float alone = see(scene, {ray})[0].passing;
  std::vector<RayQuery> many;
  for (int k = 0; k < 13; ++k) many.push_back({{-0.9f + 0.1f * static_cast<float>(k), 0.9f, 5}, {0, -0.1f, -1}, 9, 4});
  many.insert(many.begin() + 6, ray);
  CHECK(alone > 0);
  CHECK(see(scene, many)[6].passing == alone);
}

TEST_CASE("The edge between two triangles counts once, where a ray meets both") {
  SceneData data = emptyScene();
  data.materials = {veil(0.5f)};
  addVeil(data, 1, 0);
  const Scene scene(std::move(data));
  for (int k = 1; k < 100; ++k) {
    const float x = 0.02f * static_cast<float>(k) - 1;
    for (const Vec3& from : {Vec3(x, x, 0), Vec3(x, -x, 0), Vec3(x, -x + 3e-8f, 0)})
      CHECK(see(scene, {{from, {0, 0, 1}, kInfinity, 0}})[0].passing == 0.5f);
  }
}

TEST_CASE("Large surfaces among many small ones, which the hierarchy splits, count once") {
  SceneData data = emptyScene();
  data.materials = {veil(0.5f), veil(0.2f)};
  addVeil(data, 2, 0, 50);
  TriangleMesh small;
  for (int k = 0; k < 4000; ++k) {
    const float x = 0.01f * static_cast<float>(k % 100) - 0.9f, y = 0.01f * static_cast<float>(k / 100) - 0.9f;
    addQuad(small, {x, y, 2.001f + 0.0001f * static_cast<float>(k % 7)}, {0.004f, 0, 0}, {0, 0.004f, 0});
  }
  addMesh(data, std::move(small), 1);
  const Scene scene(std::move(data));
  for (int k = 0; k < 100; ++k) {
    const float x = -0.9f + 0.0087f * static_cast<float>(k) + 0.003f;
    const float passing = see(scene, {{{x, -0.7f, 0}, {0, 0, 1}, kInfinity, 0}})[0].passing;
    CAPTURE(x);
    const bool known = std::abs(passing - 0.5f) < 1e-6f || std::abs(passing - 0.4f) < 1e-6f;
    CHECK(known);
  }
}

TEST_CASE("More veils than a ray can tell hide what lies behind them; so many it still tells") {
  for (const int veils : {CrossedSurfaces::kMost, CrossedSurfaces::kMost + 1}) {
    SceneData data = emptyScene();
    data.materials = {veil(0.01f)};
    for (int k = 0; k < veils; ++k) addVeil(data, 1 + 0.01f * static_cast<float>(k), 0);
    const Scene scene(std::move(data));
    const Seen seen = see(scene, {{{0.5f, 0.3f, 0}, {0, 0, 1}, kInfinity, 0}})[0];
    CHECK(seen.hidden == (veils > CrossedSurfaces::kMost));
    if (!seen.hidden) CHECK(seen.passing == doctest::Approx(std::pow(0.99f, 64.0f)).epsilon(1e-5));
  }
}

TEST_CASE("Connections to the camera pass back faces of single-sided veils, others take their share") {
  SceneData data = emptyScene();
  data.materials = {veil(0.5f)};
  data.materials[0].doubleSided = false;
  addVeil(data, 1, 0);
  const Scene scene(std::move(data));
  const Vec3 below(0.5f, 0.3f, 0), up(0, 0, 1);
  const std::vector<Seen> seen =
      see(scene, {{below, up, 2, kCameraRay}, {below + up * 2.0f, -up, 2, kCameraRay}, {below, up, 2, 0}});
  CHECK(seen[0].passing + seen[1].passing == 1.5f);  // one of both is the back
  CHECK(seen[2].passing == 0.5f);
}

}  // namespace braid::test_blended_shadows
