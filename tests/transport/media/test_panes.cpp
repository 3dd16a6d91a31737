// SPDX-License-Identifier: Apache-2.0
// Light through panes: all integrators agree on what comes through thin, smooth, clear surfaces.
#include <cmath>

#include <doctest/doctest.h>

#include "tests/support/bsdf_cases.h"
#include "tests/support/statistics/pass_means.h"
#include "tests/transport/media/panes.h"

namespace braid::test_panes {

using namespace test;
using namespace test::panes;

namespace {

// Texels in two rows of two: clear, red, nearly black, half transmissive.
Texture stainedGlass() {
  auto image = std::make_shared<Image>();
  image->width = image->height = 2;
  image->channels = 3;
  image->bytes = {255, 255, 255, 250, 60, 40, 8, 8, 8, 120, 130, 240};
  return Texture(std::move(image), false, Wrap::Repeat, Wrap::Repeat, Filter::Linear);
}

enum class Light { Sun, Bulb, Lamp, Sky };

void addLight(SceneData& data, Light kind) {
  PunctualLight light;
  light.kind = kind == Light::Sun ? PunctualKind::Directional : PunctualKind::Point;
  light.position = {0.4f, 3.2f, 0.3f};
  light.range = 5;  // its window is that of the whole way, panes or not
  light.direction = glm::normalize(Vec3(-0.2f, -1, -0.3f));
  light.intensity = kind == Light::Sun ? Spectrum(3, 2.8f, 2.5f) : Spectrum(20, 18, 15);
  if (kind == Light::Sun || kind == Light::Bulb) data.lights.push_back(light);
  if (kind == Light::Sky) {
    auto image = std::make_shared<Image>();
    image->width = 4;
    image->height = 2;
    image->channels = 3;
    for (int i = 0; i < 24; ++i) image->floats.push_back(i < 12 ? 0.4f + 0.1f * static_cast<float>(i) : 0.2f);
    data.environment = EnvironmentData{std::move(image), Spectrum(1), 0};
  }
  if (kind != Light::Lamp) return;
  data.materials.push_back(diffuseMaterial(Spectrum(0.1f), Spectrum(8, 7, 6)));
  TriangleMesh lamp;
  addQuad(lamp, {-0.7f, 3, -0.7f}, {1.4f, 0, 0}, {0, 0, 1.4f});
  addMesh(data, std::move(lamp), static_cast<uint32_t>(data.materials.size() - 1));
}

// A floor, two walls and a mirror under a roof of glass, half of the picture seen through an upright pane. Under lights
// without size nothing mirrors: no camera path could find what that does.
SceneData glazed(const Material& glass, Light light, bool textured = false) {
  SceneData data;
  Material mirror = diffuseMaterial(Spectrum(0.9f));
  mirror.metallic = 1;
  mirror.roughness = 0;
  data.materials = {diffuseMaterial(Spectrum(0.7f)), diffuseMaterial({0.6f, 0.2f, 0.1f}), mirror, glass};
  if (light == Light::Sun || light == Light::Bulb) {
    data.materials[2].roughness = 0.4f;
    data.materials[3].specular = 0;
  }
  TriangleMesh white, red, shiny, roof, upright;
  addQuad(white, {-1.5f, 0, 1.5f}, {3, 0, 0}, {0, 0, -3});
  addQuad(white, {-1.5f, 0, -1.5f}, {3, 0, 0}, {0, 2, 0});
  addQuad(red, {-1.5f, 0, 1.5f}, {0, 0, -3}, {0, 2, 0});
  addQuad(shiny, {0.9f, 0, -1.2f}, {0.5f, 0, 0.8f}, {0, 1.2f, 0});
  addQuad(roof, {-1.6f, 1.9f, -1.6f}, {3.2f, 0, 0}, {0, 0.2f, 3.2f});
  addQuad(upright, {-1.4f, 0.05f, 0.6f}, {1.5f, 0, 0.2f}, {0, 1.4f, 0});
  if (textured) {
    data.textures.push_back(stainedGlass());
    data.materials[3].baseColorTexture.texture = data.materials[3].transmissionTexture.texture = 0;
    roof.uv[0] = upright.uv[0] = {{0, 0}, {2, 0}, {2, 2}, {0, 2}};
    upright.colors = {{1, 1, 1, 1}, {0.2f, 1, 1, 1}, {1, 1, 0.2f, 1}, {1, 1, 1, 1}};
  }
  addMesh(data, std::move(white), 0);
  addMesh(data, std::move(red), 1);
  addMesh(data, std::move(shiny), 2);
  addMesh(data, std::move(roof), 3);
  addMesh(data, std::move(upright), 3);
  addLight(data, light);
  data.cameras.push_back(cameraAt({0.2f, 1.1f, 3.4f}, {0, 0.7f, 0}));
  return data;
}

// The unbiased integrators agree block by block, the others with the mean to `bias`.
void checkAgree(const std::string& name, const Scene& scene, int maxDepth = 8) {
  constexpr int kWidth = 16, kHeight = 12, kBlock = 4;
  const auto means = [&](const char* integrator, uint64_t passes, uint64_t seed) {
    Settings s = settingsOf(integrator, kWidth, kHeight, passes, seed);
    s.maxDepth = maxDepth;
    return passMeans(scene, s, kBlock);
  };
  const std::vector<Measured> truth = means("bdpt", 1500, 1);
  for (const char* integrator : {"pt", "crn", "gdpt"}) {
    const double d = disagreement(means(integrator, integrator[0] == 'g' ? 700 : 1500, 2), truth);
    MESSAGE(name, ": ", std::string(integrator), " against bdpt, largest z over its limit ", d);
    CHECK(d < 1);
  }
  constexpr double kBias = 0.015;  // of photons and merging at edges
  const auto mean = [](const std::vector<Measured>& blocks) {
    Measured m;
    for (const Measured& b : blocks) {
      m.value += b.value / static_cast<double>(blocks.size());
      m.error = std::hypot(m.error, b.error / static_cast<double>(blocks.size()));
    }
    m.error *= 4;  // blocks that share light paths go together
    return m;
  };
  const Measured expected = mean(truth);
  for (const char* integrator : {"sppm", "vcm"}) {
    const Measured m = mean(means(integrator, 400, 3));
    MESSAGE(name, ": ", std::string(integrator), " / bdpt ", m.value / expected.value, " +- ",
            std::hypot(m.error, expected.error) / expected.value);
    CHECK(std::fabs(m.value - expected.value) <=
          kBias * expected.value + kSigmas * std::hypot(m.error, expected.error));
  }
}

}  // namespace

TEST_CASE("Sun and bulb through thin clear glass light the floor by 0.96, with every integrator") {
  for (const Light kind : {Light::Sun, Light::Bulb}) {
    SceneData data;
    data.materials = {diffuseMaterial(Spectrum(0.8f)), pane()};
    TriangleMesh floor, glass;
    addQuad(floor, {-0.5f, -0.5f, 0}, {1, 0, 0}, {0, 1, 0});
    addQuad(glass, {-3, -3, 1}, {6, 0, 0}, {0, 6, 0});
    addMesh(data, std::move(floor), 0);
    addMesh(data, std::move(glass), 1);
    PunctualLight light;
    light.kind = kind == Light::Sun ? PunctualKind::Directional : PunctualKind::Point;
    light.position = {0, 0, 20};
    light.intensity = Spectrum(kind == Light::Sun ? kPi : 400 * kPi);
    data.lights.push_back(light);
    data.cameras.push_back(spotCamera({0, 0, 0.9f}, Vec3(0), 0.02f, {0, 1, 0}));
    const Scene scene(std::move(data));
    for (const char* integrator : {"pt", "crn", "gdpt", "bdpt", "vcm", "sppm"}) {
      CAPTURE(std::string(integrator));
      Settings s = settingsOf(integrator, 4, 4, 16);
      s.maxDepth = 2;  // what the glass sends back to the floor counts no more
      CHECK(makePlan(scene, scene.data().cameras[0], s, integrators()).unreachable.empty());
      const Measured m = meanOf(render(scene, s));
      // The bulb's corners of the spot are 1e-6 further away.
      CHECK(m.value == doctest::Approx(0.768).epsilon(1e-3));
    }
    // From the ground up to the pane and back: the sun is no caustic any more.
    Settings s = settingsFor(16, 16, 1);
    s.integrators = {"auto"};
    const Plan plan = makePlan(scene, scene.data().cameras[0], s, integrators());
    REQUIRE(plan.integrators.size() == 1);
    CHECK(std::string(plan.integrators[0].integrator->name()) == "pt");
  }
}

TEST_CASE("All integrators agree on clear panes under every kind of light") {
  for (const auto& [name, light] : {std::pair("sun", Light::Sun), std::pair("bulb", Light::Bulb),
                                    std::pair("lamp", Light::Lamp), std::pair("sky", Light::Sky)})
    checkAgree(name, Scene(glazed(pane(), light)));
}

TEST_CASE("All integrators agree on stained, part diffuse, metallic, coated, glowing, veiled and thick panes") {
  checkAgree("stained", Scene(glazed(pane(), Light::Bulb, true)));
  checkAgree("half transmissive", Scene(glazed(pane({0.9f, 0.6f, 0.4f}, 0, 0.5f), Light::Lamp)));
  Material mixed = pane({0.8f, 0.9f, 0.7f}, 0, 0.7f);
  mixed.metallic = 0.4f;
  mixed.clearcoat = 1;
  mixed.clearcoatRoughness = 0.4f;
  checkAgree("metallic and coated", Scene(glazed(mixed, Light::Lamp)));
  Material glowing = pane({0.7f, 0.8f, 0.9f}, 0, 0.8f);
  glowing.emission = Spectrum(0.3f, 0.2f, 0.1f);
  checkAgree("glowing", Scene(glazed(glowing, Light::Sun)));
  Material veil = pane({0.6f, 0.9f, 0.9f});
  veil.alphaMode = AlphaMode::Blend;
  veil.alpha = 0.6f;
  checkAgree("alpha-blended", Scene(glazed(veil, Light::Bulb)));
  // Just smooth, and just not.
  checkAgree("roughness 0.031", Scene(glazed(pane(Spectrum(1), 0.031f), Light::Lamp)));
  checkAgree("roughness 0.1", Scene(glazed(pane(Spectrum(1), 0.1f), Light::Lamp)));
}

TEST_CASE("Panes do not count as segments: all integrators agree on short paths") {
  for (const int maxDepth : {1, 2, 3}) {
    CAPTURE(maxDepth);
    const std::string depth = " to depth " + std::to_string(maxDepth);
    checkAgree("sky" + depth, Scene(glazed(pane({0.9f, 0.8f, 0.7f}), Light::Sky)), maxDepth);
    checkAgree("lamp" + depth, Scene(glazed(pane(Spectrum(1), 0, 0.6f), Light::Lamp)), maxDepth);
  }
}

TEST_CASE("The told variance is true behind panes") {
  const Scene scene(glazed(pane({0.9f, 0.8f, 0.7f}, 0, 0.7f), Light::Lamp));
  for (const char* integrator : {"pt", "bdpt"}) {
    Settings s = settingsOf(integrator, 12, 8, 16);
    s.clamp = 1;
    checkCalibrated(integrator, reportedOverEmpirical(scene, s, 200));
  }
}

TEST_CASE("Pixels behind panes depend neither on threads nor on what is left out") {
  const auto image = [](const char* integrator, int threads, bool full) {
    SceneOptions options;
    options.full = full;
    const Scene scene(glazed(pane({0.9f, 0.8f, 0.7f}, 0, 0.7f), Light::Lamp, true), options);
    Settings s = settingsOf(integrator, 40, 24, 2, 0, SamplerKind::Sobol);
    s.threads = threads;
    return render(scene, s);
  };
  for (const char* integrator : {"pt", "crn", "gdpt", "bdpt", "vcm", "sppm"}) {
    CAPTURE(std::string(integrator));
    const RenderResult one = image(integrator, 1, false);
    CHECK(sameBits(one.image, image(integrator, 3, false).image));
    CHECK(sameBits(one.image, image(integrator, 2, true).image));
  }
}

TEST_CASE("The environment behind a pane is no background: alpha stays 1, its light comes through") {
  SceneData data;
  data.materials = {pane()};
  TriangleMesh glass;
  addQuad(glass, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0});
  addMesh(data, std::move(glass), 0);
  data.environment = EnvironmentData{nullptr, Spectrum(1), 0};
  data.cameras.push_back(spotCamera({0, 0, 2}, Vec3(0), 0.1f));
  const Scene scene(std::move(data));
  for (const char* integrator : {"pt", "gdpt", "bdpt", "vcm", "sppm"}) {
    CAPTURE(std::string(integrator));
    Settings s = settingsOf(integrator, 8, 8, 16);
    s.transparent = true;
    const RenderResult r = render(scene, s);
    REQUIRE(r.alpha);
    for (const float a : r.alpha->data) CHECK(a == 1);
    CHECK(meanOf(r).value == doctest::Approx(1).epsilon(1e-4));
  }
}

TEST_CASE("A furnace of panes keeps its radiance") {
  // White walls behind panes that absorb nothing: every ray sees the same.
  SceneData data = furnace(0.5f, 0.5f);
  data.materials.push_back(pane());
  TriangleMesh ball, quad;
  addSphere(ball, Vec3(0.3f, 0, -0.3f), 0.2f, 2);
  addQuad(quad, {-0.3f, -0.3f, -0.6f}, {0.6f, 0, 0.1f}, {0, 0.6f, 0});
  addMesh(data, std::move(ball), 1);
  addMesh(data, std::move(quad), 1);
  const Scene scene(std::move(data));
  for (const char* integrator : {"pt", "crn", "gdpt", "bdpt", "vcm", "sppm"}) {
    CAPTURE(std::string(integrator));
    const Measured m = meanOverSeeds(scene, settingsOf(integrator, 12, 12, 32), 6, 0);
    MESSAGE(std::string(integrator), ": ", m.value, " +- ", m.error);
    CHECK(std::fabs(m.value - 1) < 3e-3 + 5 * m.error);
    CHECK(m.error < 0.01);
  }
}

TEST_CASE("Light of a pane's far side counts as direct, however it is found") {
  const Scene scene(glazed(pane(), Light::Lamp));
  Settings s = settingsOf("pt", 16, 12, 256);
  s.keep.directIndirect = true;
  s.maxDepth = 2;  // nothing but direct light, and what the mirror and the panes reflect
  const Estimate e = estimateOf(render(scene, s));
  double direct = 0, all = 0;
  for (size_t i = 0; i < e.mean.size(); ++i) {
    direct += static_cast<double>(e.direct.mean[1][i]);
    all += static_cast<double>(e.mean[1][i]);
  }
  CHECK(direct == doctest::Approx(all).epsilon(1e-5));
}

}  // namespace braid::test_panes
