// SPDX-License-Identifier: Apache-2.0
// What must not change an image, bit for bit or in expectation: threads, crops, units of light and length, pruning.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/scene/data/gltf.h"
#include "tests/support/render_fixture.h"

namespace braid::test_invariance {

using namespace test;

namespace {

SceneData load(const char* name, bool keepAll = false) {
  LoadOptions options;
  options.keepAllAttributes = keepAll;
  return loadGltf(sourcePath(std::string("scenes/") + name + ".glb"), options);
}

// The Cornell box with a veil before the camera, so that rays are filtered.
SceneData veiledBox() {
  SceneData data = cornellBox();
  Material veil = diffuseMaterial(Spectrum(0.2f));
  veil.alphaMode = AlphaMode::Blend;
  veil.alpha = 0.4f;
  data.materials.push_back(veil);
  TriangleMesh mesh;
  addQuad(mesh, {-0.8f, -0.8f, 0.9f}, {1.2f, 0, 0}, {0.1f, 1.5f, -0.3f});
  addMesh(data, std::move(mesh), static_cast<uint32_t>(data.materials.size() - 1));
  return data;
}

// A box with every kind of light and a glass block.
SceneData litBox() {
  SceneData data = cornellBox();
  Material glass;
  glass.metallic = 0;
  glass.roughness = 0.2f;
  glass.transmission = 1;
  glass.thinWalled = false;
  glass.attenuationColor = Spectrum(0.3f, 0.8f, 0.9f);
  glass.attenuationDistance = 0.2f;
  data.materials.push_back(glass);
  TriangleMesh ball;
  addSphere(ball, {0.4f, -0.1f, 0.4f}, 0.25f, 3);
  addMesh(data, std::move(ball), static_cast<uint32_t>(data.materials.size() - 1));
  for (const PunctualKind kind : {PunctualKind::Point, PunctualKind::Spot, PunctualKind::Directional}) {
    PunctualLight light;
    light.kind = kind;
    light.intensity = kind == PunctualKind::Directional ? Spectrum(1) : Spectrum(0.5f, 0.4f, 0.3f);
    light.position = kind == PunctualKind::Point ? Vec3(-0.5f, 0.2f, 0.5f) : Vec3(0.5f, 0.5f, 0.8f);
    light.direction = glm::normalize(Vec3(-0.2f, -0.4f, -1));
    light.range = kind == PunctualKind::Point ? 1.5f : kInfinity;
    data.lights.push_back(light);
  }
  data.environment = EnvironmentData{nullptr, Spectrum(0.1f, 0.2f, 0.3f), 0};
  return data;
}

// Multiplies all light by a factor.
void brighten(SceneData& data, float factor) {
  for (Material& m : data.materials) m.emission *= factor;
  for (PunctualLight& l : data.lights) l.intensity *= factor;
  if (data.environment) data.environment->radiance *= factor;
}

// Changes the unit of length: radiance stays.
void enlarge(SceneData& data, float s) {
  for (TriangleMesh& mesh : data.meshes)
    for (Vec3& p : mesh.positions) p *= s;
  for (MeshInstance& i : data.instances) i.toWorld[3] *= Vec4(s, s, s, 1);
  for (CameraData& c : data.cameras) {
    c.toWorld[3] *= Vec4(s, s, s, 1);
    c.xmag *= s;
    c.ymag *= s;
  }
  for (Material& m : data.materials) m.attenuationDistance *= s;
  for (PunctualLight& l : data.lights) {
    l.position *= s;
    l.range *= s;
    if (l.kind != PunctualKind::Directional) l.intensity *= s * s;
  }
}

void translate(SceneData& data, const Vec3& t) {
  for (MeshInstance& i : data.instances) i.toWorld[3] += Vec4(t, 0);
  for (CameraData& c : data.cameras) c.toWorld[3] += Vec4(t, 0);
  for (PunctualLight& l : data.lights) l.position += t;
}

void checkThreads(const Scene& scene, const Settings& base) {
  Settings settings = base;
  settings.threads = 1;
  const RenderResult one = render(scene, settings);
  for (const int threads : {2, 5}) {
    settings.threads = threads;
    const RenderResult many = render(scene, settings);
    CHECK(sameBits(estimateOf(one), estimateOf(many)));
    CHECK(sameBits(estimateOf(one).variance, estimateOf(many).variance));
    CHECK(sameBits(one.estimates->features->albedo.mean, many.estimates->features->albedo.mean));
    CHECK(one.rays == many.rays);
  }
}

Rgb<float> cut(const Rgb<float>& image, const PixelWindow& w) {
  Rgb<float> out(w.width(), w.height());
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < out.height(); ++y)
      for (int x = 0; x < out.width(); ++x) out[c].at(x, y) = image[c].at(w.x0 + x, w.y0 + y);
  return out;
}

void checkCrop(const Scene& scene, const Settings& base, const PixelWindow& window) {
  Settings settings = base;
  const RenderResult full = render(scene, settings);
  settings.crop = window;
  const RenderResult crop = render(scene, settings);
  CHECK(crop.estimates->window == window);
  CHECK(sameBits(cut(estimateOf(full).mean, window), estimateOf(crop).mean));
  for (int h = 0; h < 2; ++h) CHECK(sameBits(cut(estimateOf(full).half[h], window), estimateOf(crop).half[h]));
  const Rgb<float>& normal = full.estimates->features->normal.mean;
  CHECK(sameBits(cut(normal, window), crop.estimates->features->normal.mean));
}

Settings withFeatures(int width, int height, uint64_t spp) {
  Settings settings = settingsFor(width, height, spp);
  settings.keep.features = true;
  return settings;
}

// relative L2 distance
double relativeError(const Rgb<float>& image, const Rgb<float>& reference) {
  double error = 0, total = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < image.size(); ++i) {
      error += sqr(static_cast<double>(image[c][i]) - static_cast<double>(reference[c][i]));
      total += sqr(static_cast<double>(reference[c][i]));
    }
  return std::sqrt(error / total);
}

}  // namespace

TEST_CASE("invariance: pixels do not depend on the number of threads") {
  checkThreads(Scene(cornellBox()), withFeatures(50, 37, 5));
  checkThreads(Scene(veiledBox()), withFeatures(50, 37, 5));
  checkThreads(Scene(load("foliage")), withFeatures(50, 37, 4));
  checkThreads(Scene(load("hair")), withFeatures(50, 37, 2));
}

TEST_CASE("invariance: a crop is that region of the full frame") {
  const PixelWindow window{7, 5, 42, 30};
  checkCrop(Scene(cornellBox()), withFeatures(50, 37, 6), window);
  checkCrop(Scene(veiledBox()), withFeatures(50, 37, 6), window);
  checkCrop(Scene(load("foliage")), withFeatures(50, 37, 4), window);
  checkCrop(Scene(load("hair")), withFeatures(50, 37, 2), window);
  Settings settings = withFeatures(50, 37, 3);
  settings.filter = PixelFilter::BlackmanHarris;
  settings.sampler = SamplerKind::Independent;
  checkCrop(Scene(litBox()), settings, {49, 36, 50, 37});
  checkCrop(Scene(litBox()), settings, {1, 0, 18, 37});
}

TEST_CASE("invariance: twice the light is twice the image, to the bit") {
  for (const LightStrategy strategy : {LightStrategy::Power, LightStrategy::Hierarchy})
    for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
      Settings settings = settingsFor(40, 40, 16, sampler);
      settings.lightStrategy = strategy;
      const RenderResult once = render(litBox(), settings);
      for (const float factor : {2.0f, 1.0f / 1024}) {
        SceneData data = litBox();
        brighten(data, factor);
        Rgb<float> expected = estimateOf(once).mean;
        for (size_t c = 0; c < 3; ++c)
          for (float& v : expected[c].data) v *= factor;
        CHECK(sameBits(estimateOf(render(data, settings)).mean, expected));
      }
    }
}

TEST_CASE("invariance: the unit of length does not change the image") {
  Settings settings = settingsFor(40, 40, 64);
  const RenderResult metres = render(litBox(), settings);
  settings.seed = 1;
  for (const float s : {1e-3f, 1e3f}) {
    SceneData data = litBox();
    enlarge(data, s);
    const RenderResult scaled = render(data, settings);
    CAPTURE(s);
    CHECK(disagreement(metres, scaled) < 1);
    CHECK(zScore(meanOf(metres), meanOf(scaled)) < kSigmas);
    CHECK(scaled.rejected == 0);
  }
  // A different scene is told apart.
  SceneData other = litBox();
  brighten(other, 1.1f);
  CHECK(disagreement(metres, render(other, settings)) > 1);
}

TEST_CASE("invariance: a scene a thousand times its size away from the origin is still itself") {
  const Settings settings = settingsFor(40, 40, 64);
  const RenderResult here = render(litBox(), settings);
  for (const Vec3& t : {Vec3(2000, 0, 0), Vec3(-1200, 2000, 1500)}) {
    SceneData data = litBox();
    translate(data, t);
    const RenderResult there = render(data, settings);
    CHECK(there.rejected == 0);
    MESSAGE("moved by ", glm::length(t), " m: mean ", meanOf(there).value / meanOf(here).value, " of that at home");
    for (size_t c = 0; c < 3; ++c)
      CHECK(meanOf(there, c).value == doctest::Approx(meanOf(here, c).value).epsilon(0.02));
  }
}

TEST_CASE("invariance: leaving nothing out gives the same pixels") {
  const auto check = [](const SceneData& pruned, SceneData full, uint64_t spp) {
    Settings settings = withFeatures(48, 32, spp);
    settings.keep.quarters = true;
    const RenderResult lean = render(pruned, settings);
    settings.full = true;
    SceneOptions options;
    options.full = true;
    const RenderResult complete = render(std::move(full), settings, options);
    CHECK(sameBits(estimateOf(lean), estimateOf(complete)));
    CHECK(sameBits(estimateOf(lean).variance, estimateOf(complete).variance));
    CHECK(sameBits(lean.estimates->features->albedo.mean, complete.estimates->features->albedo.mean));
    CHECK(lean.rejected == 0);
  };
  check(cornellBox(), cornellBox(), 16);
  for (const char* name : {"cornell", "foliage", "materials", "hair"}) {
    CAPTURE(std::string(name));
    check(load(name), load(name, true), 4);
  }
}

TEST_CASE("invariance: low-discrepancy points need less than half of the passes on the Cornell box") {
  const Scene scene(cornellBox());
  Settings settings = settingsFor(32, 32, 4096, SamplerKind::Independent);
  settings.seed = 1000;
  const Rgb<float> reference = estimateOf(render(scene, settings)).mean;
  double error[2] = {0, 0};
  for (uint64_t seed = 0; seed < 4; ++seed)
    for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
      settings = settingsFor(32, 32, 64, sampler);
      settings.seed = seed;
      const double e = relativeError(estimateOf(render(scene, settings)).mean, reference);
      error[sampler == SamplerKind::Sobol] += e / 4;
    }
  MESSAGE("relative error at 64 passes: independent ", error[0], ", sobol ", error[1], ", ratio ", error[1] / error[0]);
  CHECK(error[1] < 0.7 * error[0]);
}

}  // namespace braid::test_invariance
