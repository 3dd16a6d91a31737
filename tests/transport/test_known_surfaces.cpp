// SPDX-License-Identifier: Apache-2.0
// Surfaces and geometry whose effect on light is known: absorbing glass, panes, coverage, unlit, instances, path depth.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/transport/bsdf/fresnel.h"
#include "tests/support/render_fixture.h"

namespace braid::test_known_surfaces {

using namespace test;

namespace {

Spectrum power(const Spectrum& s, float exponent) {
  return {std::pow(s.x, exponent), std::pow(s.y, exponent), std::pow(s.z, exponent)};
}

// All pixels have this colour.
void checkColor(const RenderResult& result, const Spectrum& expected, double tolerance = 2e-5) {
  for (size_t c = 0; c < 3; ++c)
    for (const float v : estimateOf(result).mean[c].data)
      CHECK(v == doctest::Approx(expected[static_cast<int>(c)]).epsilon(tolerance));
}

void checkMean(const RenderResult& result, const Spectrum& expected) {
  for (size_t c = 0; c < 3; ++c) {
    const Measured m = meanOf(result, c);
    CAPTURE(m.value);
    CAPTURE(m.error);
    CHECK(zScore(m, static_cast<double>(expected[static_cast<int>(c)])) < kSigmas);
  }
}

TriangleMesh box(const Vec3& lo, const Vec3& hi) {
  TriangleMesh mesh;
  const Vec3 d = hi - lo, x(d.x, 0, 0), y(0, d.y, 0), z(0, 0, d.z);
  addQuad(mesh, lo, y, x);
  addQuad(mesh, lo, x, z);
  addQuad(mesh, lo, z, y);
  addQuad(mesh, hi, -x, -y);
  addQuad(mesh, hi, -z, -x);
  addQuad(mesh, hi, -y, -z);
  return mesh;
}

Material glass(float ior, bool thin) {
  Material m;
  m.metallic = 0;
  m.roughness = 0;
  m.transmission = 1;
  m.ior = ior;
  m.thinWalled = thin;
  return m;
}

// Half transparent, black.
Material veil(float alpha) {
  Material m = diffuseMaterial(Spectrum(0));
  m.alphaMode = AlphaMode::Blend;
  m.alpha = alpha;
  return m;
}

TriangleMesh square(float half, float z) {
  TriangleMesh mesh;
  addQuad(mesh, {-half, -half, z}, {2 * half, 0, 0}, {0, 2 * half, 0});
  return mesh;
}

SceneData under(const Spectrum& environment, const CameraData& camera) {
  SceneData data;
  data.environment = EnvironmentData{nullptr, environment, 0};
  data.cameras = {camera};
  return data;
}

void addWith(SceneData& data, TriangleMesh mesh, const Material& material) {
  data.materials.push_back(material);
  addMesh(data, std::move(mesh), static_cast<uint32_t>(data.materials.size() - 1));
}

}  // namespace

TEST_CASE("known surface: a slab of index 1 absorbs by Beer and Lambert, tinted at both faces") {
  Material m = glass(1, false);
  m.attenuationColor = Spectrum(0.9f, 0.5f, 0.1f);
  m.attenuationDistance = 0.4f;
  m.baseColor = Spectrum(0.8f, 1, 1);
  for (const float angle : {0.0f, 0.6f, 1.2f}) {
    const Vec3 from(5 * std::sin(angle), 0, 5 * std::cos(angle));
    SceneData data = under(Spectrum(2), spotCamera(from, Vec3(0), 0.01f));
    addWith(data, box({-20, -20, -0.15f}, {20, 20, 0.15f}), m);
    const Spectrum through = power(m.attenuationColor, 0.3f / std::cos(angle) / 0.4f);
    CAPTURE(angle);
    checkColor(render(data, settingsFor(4, 4, 4)), 2.0f * through * m.baseColor * m.baseColor, 1e-4);
  }
}

TEST_CASE("known surface: a solid inside a solid of the same index leaves its volume to one of them") {
  // The later material rules where both are: 0.2 m of it and 0.4 m of the other.
  Material outer = glass(1.5f, false), inner = glass(1.5f, false);
  outer.attenuationColor = Spectrum(0.5f, 1, 1);
  inner.attenuationColor = Spectrum(1, 0.5f, 1);
  outer.attenuationDistance = inner.attenuationDistance = 0.2f;
  SceneData data = under(Spectrum(1), spotCamera({0, 0, 5}, Vec3(0), 0.01f));
  addWith(data, box(Vec3(-0.3f), Vec3(0.3f)), outer);
  addWith(data, box(Vec3(-0.1f), Vec3(0.1f)), inner);
  // One reflection at either face, back and forth inside: (1 - F)² t / (1 - F² t²), and F + (1 - F)² F t² / (1 - F²
  // t²).
  const auto slab = [](double t) {
    const double f = 0.04, rest = 1 - f * f * t * t;
    return (1 - f) * (1 - f) * t / rest + f + (1 - f) * (1 - f) * f * t * t / rest;
  };
  checkMean(render(data, settingsFor(32, 32, 256)),
            Spectrum(static_cast<float>(slab(0.25)), static_cast<float>(slab(0.5)), 1));
}

TEST_CASE("known surface: a thin pane transmits 1 - F of its colour and reflects F") {
  const Spectrum color(0.9f, 0.6f, 0.3f);
  Material pane = glass(1.5f, true);
  pane.baseColor = color;
  pane.doubleSided = true;
  for (const float angle : {0.0f, 0.8f}) {
    const Vec3 from(3 * std::sin(angle), 0, 3 * std::cos(angle));
    const double schlick = 0.04 + 0.96 * std::pow(1 - std::cos(static_cast<double>(angle)), 5);
    const auto reflected = static_cast<float>(schlick);
    CAPTURE(angle);
    for (const bool behind : {true, false}) {
      SceneData data;
      data.cameras = {spotCamera(from, Vec3(0), 0.01f)};
      addWith(data, square(2, 0), pane);
      Material lamp = diffuseMaterial(Spectrum(0), Spectrum(5));
      lamp.doubleSided = false;
      TriangleMesh quad;
      if (behind) addQuad(quad, {-50, -50, -1}, {100, 0, 0}, {0, 100, 0});
      if (!behind) addQuad(quad, {-50, -50, 9}, {0, 100, 0}, {100, 0, 0});
      addWith(data, quad, lamp);
      checkMean(render(data, settingsFor(32, 32, 256)),
                behind ? 5.0f * (1 - reflected) * color : Spectrum(5 * reflected));
    }
  }
}

TEST_CASE("known surface: coverage 0.3 hides 0.3 from the camera, from shadow rays and from scattered rays") {
  SceneData data = under(Spectrum(1), spotCamera({0, 0, 5}, Vec3(0), 0.5f));
  addWith(data, square(2, 0), veil(0.3f));
  checkMean(render(data, settingsFor(32, 32, 64)), Spectrum(0.7f));
  // A second veil decides by itself.
  addWith(data, square(2, 1), veil(0.3f));
  checkMean(render(data, settingsFor(32, 32, 64)), Spectrum(0.49f));
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
    // A floor in a box of veils under the environment; the camera inside.
    SceneData hall = under(Spectrum(1), spotCamera({0, 0, 0.5f}, Vec3(0), 0.1f));
    addWith(hall, square(10, 0), diffuseMaterial(Spectrum(0.8f, 0.5f, 0.1f)));
    addWith(hall, box(Vec3(-5), Vec3(5)), veil(0.3f));
    checkMean(render(hall, settingsFor(32, 32, 256, sampler)), 0.7f * Spectrum(0.8f, 0.5f, 0.1f));
    // A point light above two veils.
    SceneData lamp = under(Spectrum(0), spotCamera({0, 0, 0.5f}, Vec3(0), 1e-3f));
    addWith(lamp, square(10, 0), diffuseMaterial(Spectrum(0.5f)));
    addWith(lamp, square(10, 1), veil(0.3f));
    addWith(lamp, square(10, 1.5f), veil(0.3f));
    PunctualLight light;
    light.position = Vec3(0, 0, 2);
    light.intensity = Spectrum(4 * kPi);
    lamp.lights = {light};
    checkMean(render(lamp, settingsFor(32, 32, 64, sampler)), Spectrum(0.5f * 0.49f));
  }
}

TEST_CASE("known surface: an unlit surface shows its colour to the camera and to mirrors and lights nothing") {
  Material sign = diffuseMaterial(Spectrum(0.2f, 0.5f, 0.8f));
  sign.unlit = true;
  SceneData data = under(Spectrum(3), spotCamera({0, 0, 5}, Vec3(0), 0.5f));
  addWith(data, square(2, 0), sign);
  checkColor(render(data, settingsFor(8, 8, 2)), sign.baseColor);

  Material mirror = diffuseMaterial(Spectrum(1));
  mirror.metallic = 1;
  mirror.roughness = 0;
  for (const Material& floor : {diffuseMaterial(Spectrum(0.8f)), mirror}) {
    SceneData room = under(Spectrum(0), spotCamera({0, 0, 0.5f}, Vec3(0), 0.1f));
    addWith(room, square(10, 0), floor);
    addWith(room, square(10, 1), sign);
    checkColor(render(room, settingsFor(8, 8, 16)), floor.metallic > 0 ? sign.baseColor : Spectrum(0));
  }
}

TEST_CASE("known surface: depth counts segments: one sees emission only, two direct light") {
  SceneData data = cornellBox();
  Settings settings = settingsFor(32, 32, 16);
  settings.maxDepth = 1;
  const RenderResult emission = render(data, settings);
  const Camera camera(data.cameras[0], 32, 32);
  // The light's pixels by projection of its corners, a pixel off the edges.
  const Vec2 a = *camera.project({-0.24f, 1, 0.2f}), b = *camera.project({0.24f, 1, -0.2f});
  double lit = 0;
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 32; ++x) {
      const Vec3 v = estimateOf(emission).mean.pixel(static_cast<size_t>(y * 32 + x));
      const Vec2 p(static_cast<float>(x), static_cast<float>(y));
      if (p.x > b.x + 1 || p.x + 1 < a.x - 1 || p.y > b.y + 1 || p.y + 1 < a.y - 1) CHECK(v == Vec3(0));
      CHECK(v.y == doctest::Approx(v.x * 12 / 17));
      lit += static_cast<double>(v.x) / 17;
    }
  CHECK(lit > 3);
  settings.maxDepth = 2;
  settings.spp = 64;
  const RenderResult direct = render(data, settings);
  CHECK(meanOf(direct).value > meanOf(emission).value);
  // The ceiling lies in the light's plane: no light before the third segment.
  const Vec2 ceiling = *camera.project({-0.5f, 1, 0.5f});
  const auto pixel = static_cast<size_t>(static_cast<int>(ceiling.y) * 32 + static_cast<int>(ceiling.x));
  CHECK(estimateOf(direct).mean.pixel(pixel) == Vec3(0));
  settings.maxDepth = 3;
  CHECK(minComponent(estimateOf(render(data, settings)).mean.pixel(pixel)) > 0);
}

namespace {

// Something without symmetry: single-sided surfaces, an emitter and a glass ball with smooth normals.
std::vector<std::pair<TriangleMesh, Material>> ornament() {
  Material shell = diffuseMaterial(Spectrum(0.8f, 0.5f, 0.3f));
  shell.doubleSided = false;
  Material lamp = diffuseMaterial(Spectrum(0.1f), Spectrum(4, 5, 6));
  lamp.doubleSided = false;
  Material ball = glass(1.4f, false);
  ball.attenuationColor = Spectrum(0.3f, 0.9f, 0.6f);
  ball.attenuationDistance = 0.3f;
  TriangleMesh shellMesh, lampMesh, ballMesh;
  addQuad(shellMesh, {0, -0.5f, 0}, {0.9f, 0, 0.3f}, {0.1f, 1.1f, 0});
  addQuad(shellMesh, {-0.2f, -0.5f, 0.4f}, {0.1f, 0, -0.8f}, {0, 0.7f, 0.1f});
  addQuad(lampMesh, {0.1f, 0.8f, -0.2f}, {0.2f, 0, 0.3f}, {0.3f, 0, -0.1f});
  addQuad(lampMesh, {-0.3f, 0.7f, -0.2f}, {0.2f, 0, -0.2f}, {0.1f, 0, 0.3f});
  addSphere(ballMesh, {0.35f, -0.2f, 0.5f}, 0.25f, 3);
  return {{shellMesh, shell}, {lampMesh, lamp}, {ballMesh, ball}};
}

// Applies a transform to a mesh by hand; a mirror turns the winding.
TriangleMesh moved(TriangleMesh mesh, const Mat4& m) {
  for (Vec3& p : mesh.positions) p = Vec3(m * Vec4(p, 1));
  for (Vec3& n : mesh.normals) n = glm::normalize(glm::transpose(glm::inverse(Mat3(m))) * n);
  if (glm::determinant(Mat3(m)) < 0)
    for (glm::uvec3& t : mesh.triangles) std::swap(t.y, t.z);
  return mesh;
}

SceneData gallery(const std::vector<Mat4>& places, bool instanced) {
  SceneData data = under(Spectrum(0.2f, 0.3f, 0.4f), cameraAt({0, 1.5f, 5}, {0, 0, 0}));
  TriangleMesh floor;
  addQuad(floor, {-4, -0.7f, 4}, {8, 0, 0}, {0, 0, -8});
  addWith(data, floor, diffuseMaterial(Spectrum(0.6f)));
  for (const auto& [mesh, material] : ornament()) {
    data.materials.push_back(material);
    const auto m = static_cast<uint32_t>(data.materials.size() - 1);
    const auto index = static_cast<uint32_t>(data.meshes.size());
    for (const Mat4& place : places) {
      if (!instanced) addMesh(data, moved(mesh, place), m);
      if (instanced) data.instances.push_back({index, place, {}});
    }
    if (!instanced) continue;
    data.meshes.push_back(mesh);
    data.meshes.back().material = m;
  }
  return data;
}

void checkSameGallery(const std::vector<Mat4>& places) {
  Settings settings = settingsFor(40, 24, 128);
  const RenderResult flat = render(gallery(places, false), settings);
  settings.seed = 1;
  const RenderResult instanced = render(gallery(places, true), settings);
  CHECK(disagreement(flat, instanced) < 1);
  CHECK(zScore(meanOf(flat), meanOf(instanced)) < kSigmas);
  // Another place is another image: the comparison can fail.
  std::vector<Mat4> other = places;
  other[0] = glm::translate(Mat4(1), Vec3(0, 0.3f, 0)) * other[0];
  CHECK(disagreement(flat, render(gallery(other, true), settings)) > 1);
}

}  // namespace

TEST_CASE("known surface: instances equal flattened meshes") {
  const Mat4 left = glm::translate(Mat4(1), Vec3(-1, 0, 0));
  const Mat4 right = glm::rotate(glm::translate(Mat4(1), Vec3(1, 0, -0.5f)), 0.8f, Vec3(0.2f, 1, 0));
  checkSameGallery({left});
  checkSameGallery({left, right});
  checkSameGallery({left, right * glm::scale(Mat4(1), Vec3(1.3f, 0.6f, 0.9f))});
}

TEST_CASE("known surface: mirrored instances equal mirrored geometry") {
  const Mat4 left = glm::translate(Mat4(1), Vec3(-1, 0, 0)), mirror = glm::scale(Mat4(1), Vec3(-1, 1, 1));
  const Mat4 right = glm::translate(Mat4(1), Vec3(1, 0, 0)) * mirror;
  checkSameGallery({right});
  checkSameGallery({left, right});
  checkSameGallery({left * glm::scale(Mat4(1), Vec3(0.8f, 1, -1.2f)), right});
}

}  // namespace braid::test_known_surfaces
