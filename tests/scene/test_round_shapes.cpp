// SPDX-License-Identifier: Apache-2.0
// Points and lines of glTF files as spheres and capsules (--point-radius): their size, their light, their number.
#include <cmath>
#include <numbers>

#include <doctest/doctest.h>

#include "renderer/scene/data/closed_mesh.h"
#include "renderer/scene/data/round_shapes.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"

namespace braid::test_round_shapes {

using namespace test;

namespace {

constexpr double kCircle = std::numbers::pi;

LoadOptions thick(float radius) {
  LoadOptions options = GltfFile::plainLight();
  options.pointRadius = radius;
  return options;
}

// A primitive of this mode at these vertices.
GltfFile strokeFile(int mode, const std::vector<float>& positions) {
  GltfFile file;
  const int position = file.accessor<float>(positions, "VEC3");
  file.root["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", position}}}, {"mode", mode}}}}}};
  file.show();
  return file;
}

RoundShape shapeOfLevel(int level) {
  RoundShape shape;
  shape.radius = 0.5f;
  shape.level = level;
  return shape;
}

TriangleMesh meshOf(const std::vector<Vec3>& positions, int mode, const RoundShape& shape) {
  TriangleMesh spine;
  spine.positions = positions;
  std::vector<uint32_t> indices;
  for (uint32_t i = 0; i < positions.size(); ++i) indices.push_back(i);
  uint64_t lost = 0;
  TriangleMesh mesh = roundMesh(spine, strokesOf(mode, indices, positions, lost), shape);
  CHECK(lost == 0);
  return mesh;
}

glm::dvec3 normalOf(const TriangleMesh& mesh, const glm::uvec3& t) {
  const glm::dvec3 a(mesh.positions[t.x]), b(mesh.positions[t.y]), c(mesh.positions[t.z]);
  return 0.5 * glm::cross(b - a, c - a);
}

double surface(const TriangleMesh& mesh) {
  double sum = 0;
  for (const glm::uvec3& t : mesh.triangles) sum += glm::length(normalOf(mesh, t));
  return sum;
}

// Of a convex body.
double silhouette(const TriangleMesh& mesh, const glm::dvec3& direction) {
  double sum = 0;
  for (const glm::uvec3& t : mesh.triangles) sum += 0.5 * std::abs(glm::dot(normalOf(mesh, t), direction));
  return sum;
}

// The share of what an orthographic camera of half the extent sees that a black thing hides from a white sky.
Measured hidden(SceneData scene, const CameraData& camera, uint64_t spp) {
  Material black = diffuseMaterial(Spectrum(0));
  scene.materials.assign(scene.materials.size(), black);
  scene.environment = EnvironmentData{nullptr, Spectrum(1), 0};
  scene.cameras = {camera};
  const Measured sky = meanOf(render(std::move(scene), settingsFor(64, 64, spp)));
  return {1 - sky.value, sky.error};
}

}  // namespace

TEST_CASE("round shapes: at every level closed, with the surface of the sphere and the girth of the cylinder") {
  for (int level = 0; level < kRoundLevels; ++level) {
    CAPTURE(level);
    const TriangleMesh sphere = meshOf({{1, 2, 3}}, 0, shapeOfLevel(level));
    CHECK(sphere.triangles.size() == trianglesOfSphere(level));
    CHECK(isClosedOutward(sphere));
    CHECK(surface(sphere) == doctest::Approx(kCircle).epsilon(1e-5));  // 4 π r²
    // In the mean over directions (Fibonacci's) the silhouette is that of the sphere.
    double mean = 0;
    constexpr int kDirections = 2000;
    for (int i = 0; i < kDirections; ++i) {
      const double z = 1 - (2 * i + 1.0) / kDirections, phi = i * kCircle * (3 - std::sqrt(5.0));
      const double r = std::sqrt(1 - z * z);
      mean += silhouette(sphere, {r * std::cos(phi), r * std::sin(phi), z}) / kDirections;
    }
    CHECK(mean == doctest::Approx(kCircle / 4).epsilon(1e-3));
    const auto rod = [&](float length) { return meshOf({{1, 0, 0}, {1, length, 0}}, 1, shapeOfLevel(level)); };
    CHECK(rod(2).triangles.size() == trianglesOfCapsule(level));
    CHECK(isClosedOutward(rod(2)));
    // What five metres more add, in the mean over directions across the rod: their length times the diameter.
    double added = 0;
    for (int i = 0; i < kDirections; ++i) {
      const double phi = 2 * kCircle * i / kDirections;
      const glm::dvec3 across(std::cos(phi), 0, std::sin(phi));
      added += (silhouette(rod(7), across) - silhouette(rod(2), across)) / kDirections;
    }
    CHECK(added == doctest::Approx(5.0).epsilon(1e-4));
  }
}

TEST_CASE("round shapes: modes make spheres, pairs, loops and strips; capsules in a row stay closed") {
  const std::vector<float> zigzag{0, 0, 0, 1, 0, 0, 1, 1, 0, 2, 1, 0, 3, 1, 0};
  const size_t shapes[] = {5, 2, 5, 4};
  for (const int mode : {0, 1, 2, 3}) {
    CAPTURE(mode);
    const SceneData scene = strokeFile(mode, zigzag).load(thick(0.1f));
    const TriangleMesh mesh = onlyMesh(scene);
    CHECK(mesh.triangles.size() == shapes[mode] * (mode == 0 ? trianglesOfSphere(0) : trianglesOfCapsule(0)));
    CHECK(mesh.normals.size() == mesh.positions.size());
    CHECK(scene.meshes[0].positions.capacity() > mesh.positions.size());
    CHECK(isClosedOutward(mesh));
    CHECK_FALSE(hasWarning(scene, "points and lines"));
    CHECK(hasWarning(strokeFile(mode, zigzag).load(), "--point-radius METRES"));
  }
  GltfFile file = strokeFile(0, zigzag);
  file.primitive()["indices"] = file.accessor<uint16_t>({1, 1, 4, 7}, "SCALAR");
  const SceneData scene = file.load(thick(0.1f));
  CHECK(onlyMesh(scene).triangles.size() == 2 * trianglesOfSphere(0));
  CHECK(hasWarning(scene, "a point that does not exist or is not finite is dropped"));
  file = strokeFile(3, {0, 0, 0, 1, 0, 0, NAN, 0, 0, 3, 0, 0, 3, 0, 0});
  // One segment is left, and one without length, which is a ball.
  CHECK(onlyMesh(file.load(thick(0.1f))).triangles.size() == 2 * trianglesOfCapsule(0));
}

TEST_CASE("round shapes: vertex colours go with their points, along lines from end to end") {
  for (const int mode : {0, 1}) {
    GltfFile file = strokeFile(mode, {0, 0, 0, 9, 0, 0});
    file.primitive()["attributes"]["COLOR_0"] = file.accessor<float>({1, 0, 0, 0, 1, 0}, "VEC3");
    const TriangleMesh mesh = onlyMesh(file.load(thick(0.5f)));
    REQUIRE(mesh.colors.size() == mesh.positions.size());
    for (size_t v = 0; v < mesh.positions.size(); ++v)
      CHECK(mesh.colors[v] == (mesh.positions[v].x < 4.5f ? Vec4(1, 0, 0, 1) : Vec4(0, 1, 0, 1)));
  }
}

TEST_CASE("round shapes: the radius is that in the world, whatever scales, mirrors or turns a node") {
  const auto distances = [](const SceneData& scene) {
    std::pair<float, float> range(kInfinity, 0.0f);
    for (const MeshInstance& instance : scene.instances) {
      const TriangleMesh& mesh = scene.meshes[instance.mesh];
      CHECK(isClosedOutward(mesh));
      const Vec3 centre(instance.toWorld * Vec4(1, 2, 3, 1));
      for (size_t v = 0; v < mesh.positions.size(); ++v) {
        const Vec3 outward = Vec3(instance.toWorld * Vec4(mesh.positions[v], 1)) - centre;
        range = {std::min(range.first, glm::length(outward)), std::max(range.second, glm::length(outward))};
        const Vec3 normal = glm::transpose(glm::inverse(Mat3(instance.toWorld))) * mesh.normals[v];
        CHECK(glm::dot(glm::normalize(normal), glm::normalize(outward)) > 0.9999f);
      }
    }
    return range;
  };
  GltfFile file = strokeFile(0, {1, 2, 3});
  const std::pair<float, float> plain = distances(file.load(thick(0.25f)));
  CHECK(plain.second == doctest::Approx(0.25).epsilon(0.02));
  for (const Json& scale : {Json{4, 4, 4}, Json{1, 2, 3}, Json{-2, 2, 2}, Json{0.01, 1, -5}}) {
    file.node()["scale"] = scale;
    file.node()["rotation"] = {0.5, 0.5, -0.5, 0.5};
    const std::pair<float, float> found = distances(file.load(thick(0.25f)));
    CHECK(found.first == doctest::Approx(plain.first).epsilon(1e-4));
    CHECK(found.second == doctest::Approx(plain.second).epsilon(1e-4));
  }
  // Turned copies share their triangles.
  file.node()["scale"] = {2, 2, 2};
  file.root["nodes"].push_back({{"mesh", 0}, {"scale", {2, 2, 2}}, {"rotation", {0, 0.6, 0, 0.8}}});
  file.root["scenes"][0]["nodes"] = {0, 1};
  const SceneData twice = file.load(thick(0.25f));
  CHECK(twice.meshes.size() == 1);
  CHECK(twice.instances.size() == 2);
  file.node()["scale"] = {2, 0, 2};
  CHECK(hasWarning(file.load(thick(0.25f)), "points and lines that a scale of 0 makes flat are left out"));
}

TEST_CASE("round shapes: a point hides the disc of a sphere, a line the strip of a cylinder") {
  const SceneData point = strokeFile(0, {0, 0, 0}).load(thick(0.5f));
  const Measured disc = hidden(point, spotCamera({0, 0, 5}, Vec3(0), 0.75f), 64);
  CHECK(std::abs(disc.value - kCircle / 4 / 2.25) < 0.005 * kCircle / 4 / 2.25 + kSigmas * disc.error);
  // Of which the ends are not seen.
  const SceneData line = strokeFile(1, {-9, -9, 1, 9, 9, 1}).load(thick(0.25f));
  const Measured strip = hidden(line, spotCamera({0, 0, 5}, Vec3(0), 1, glm::normalize(Vec3(-1, 1, 0))), 64);
  CHECK(std::abs(strip.value - 0.25) < 0.01 * 0.25 + kSigmas * strip.error);
}

TEST_CASE("round shapes: in a white sky a diffuse point has the radiance of its albedo" *
          doctest::test_suite("statistics")) {
  SceneData scene = strokeFile(0, {0, 0, 0}).load(thick(1));
  scene.materials = {diffuseMaterial(Spectrum(0.6f))};
  scene.environment = EnvironmentData{nullptr, Spectrum(1), 0};
  scene.cameras = {spotCamera({0, 0, 5}, Vec3(0), 0.6f)};
  const Scene built(std::move(scene));
  for (const Integrator* integrator : integrators()) {
    Settings settings = settingsFor(12, 12, 32);
    settings.integrators = {integrator->name()};
    CAPTURE(std::string(integrator->name()));
    const Measured m = meanOverSeeds(built, settings, 4, 1);
    // Smooth normals on flat triangles lose half a percent; photons blur.
    CHECK(std::abs(m.value - 0.6) < (integrator->unbiased() ? 0.006 : 0.015) * 0.6 + kSigmas * m.error);
  }
}

TEST_CASE("round shapes: every integrator finds the light of shining points on lines" *
          doctest::test_suite("statistics")) {
  GltfFile file = strokeFile(0, {-0.5f, 0.6f, 0, 0.6f, 0.8f, 0.3f});
  const int lines = file.accessor<float>({-1, 0, -0.5f, 1, 0.2f, 0, 0, 0, 1, -1, 0.4f, 1}, "VEC3");
  const int colours = file.accessor<float>({1, 1, 1, 0.2f, 0.9f, 0.4f, 1, 0.5f, 0.5f, 1, 1, 1}, "VEC3");
  file.root["materials"] = {{{"emissiveFactor", {1, 1, 1}}},
                            {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0.6}}}}};
  file.primitive()["material"] = 0;
  file.root["meshes"][0]["primitives"].push_back(
      {{"attributes", {{"POSITION", lines}, {"COLOR_0", colours}}}, {"mode", 2}, {"material", 1}});
  SceneData scene = file.load(thick(0.15f));
  CHECK_FALSE(scene.environment);
  TriangleMesh floor;
  addQuad(floor, {-2, -0.3f, 2}, {4, 0, 0}, {0, 0, -4});
  addMesh(scene, std::move(floor), 1);
  scene.cameras = {cameraAt({0, 1.5f, 4}, {0, 0.2f, 0})};
  const Scene built(std::move(scene));
  CHECK(built.emitters().size() == 2 * trianglesOfSphere(0));
  Settings settings = settingsFor(20, 14, 32);
  settings.integrators = {"pt"};
  const Measured expected = meanOverSeeds(built, settings, 6, 50);
  for (const Integrator* integrator : integrators()) {
    settings.integrators = {integrator->name()};
    CAPTURE(std::string(integrator->name()));
    const Measured m = meanOverSeeds(built, settings, 6, 9);
    const double allowed = integrator->unbiased() ? 0 : 0.02 * expected.value;
    CHECK(std::abs(m.value - expected.value) < allowed + kSigmas * std::hypot(m.error, expected.error));
  }
}

TEST_CASE("round shapes: more points have fewer triangles each, too many are refused before they take memory") {
  std::vector<float> cloud(3 * 30000);
  for (size_t i = 0; i < cloud.size(); ++i) cloud[i] = static_cast<float>(i % 1000);
  CHECK(onlyMesh(strokeFile(0, cloud).load(thick(0.1f))).triangles.size() == 30000 * trianglesOfSphere(1));
  GltfFile file = strokeFile(0, {0, 0, 0});
  // An accessor without data means zeros: a few bytes claim any number.
  file.root["accessors"][0].erase("bufferView");
  file.root["accessors"][0]["count"] = 2000000;
  CHECK(errorOf([&] { file.load(thick(0.1f)); }).find("points and lines are too many") != std::string::npos);
}

}  // namespace braid::test_round_shapes
