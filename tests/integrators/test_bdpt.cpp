// SPDX-License-Identifier: Apache-2.0
// Bidirectional path tracing finds the same light as path tracing, in every way it has.
#include <cmath>
#include <map>

#include <doctest/doctest.h>

#include "integrators/light_preparation.h"
#include "integrators/bidirectional/strategies.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/statistics/calibration.h"

namespace braid::test_bdpt {

using namespace test;

namespace {

Settings bdptSettings(int width, int height, uint64_t spp, SamplerKind sampler = SamplerKind::Sobol) {
  Settings settings = settingsFor(width, height, spp, sampler);
  settings.integrators = {"bdpt"};
  return settings;
}

// Compares by blocks of pixels, false alarm 10⁻⁴ per scene where block means are near normal, and the means of
// the images within 0.3 % or 4 standard errors, whichever is wider.
void checkAgreement(const std::string& name, const Scene& scene, Settings settings, uint64_t sppPathTracer,
                    int block = 16) {
  settings.integrators = {"bdpt"};
  const RenderResult bdpt = render(scene, settings);
  settings.integrators = {"pt"};
  settings.seed = 77;
  settings.spp = sppPathTracer;
  const RenderResult pt = render(scene, settings);
  CAPTURE(name);
  CHECK(bdpt.rejected == 0);
  CHECK(disagreement(bdpt, pt, block) < 1);
  for (size_t c = 0; c < 3; ++c) {
    const Measured a = meanOf(bdpt, c), b = meanOf(pt, c);
    const double difference = std::fabs(a.value - b.value), error = std::hypot(a.error, b.error);
    MESSAGE(name, " channel ", c, ": bdpt / pt ", a.value / b.value, " +- ", error / b.value);
    CHECK(difference <= std::max(0.003 * b.value, kSigmas * error));
  }
}

SceneData glossyBox() {
  SceneData data = cornellBox();
  for (Material& m : data.materials)
    if (!m.emissive()) {
      m.specular = 1;
      m.roughness = 0.3f;
      m.metallic = 0.5f;
    }
  return data;
}

}  // namespace

TEST_CASE("bdpt equals pt on the scenes of the suite that path tracing can render") {
  for (const char* name : {"cornell", "furnace", "plates", "bookshelf", "interior", "door_ajar", "hair", "foliage",
                           "many_lights", "sun_sky", "forest", "materials"}) {
    const Scene scene(loadGltf(sourcePath("scenes/" + std::string(name) + ".glb")));
    // A block of many_lights at 32 spp is ruled by single paths that come too near to a lamp: no normal variate.
    checkAgreement(name, scene, bdptSettings(96, 96, 32), 128, std::string(name) == "many_lights" ? 96 : 16);
  }
}

TEST_CASE("bdpt equals pt with an orthographic camera, every pixel filter, and a crop") {
  SceneData data = cornellBox();
  data.cameras[0].orthographic = true;
  data.cameras[0].xmag = data.cameras[0].ymag = 0.9f;
  const Scene scene(std::move(data));
  for (const PixelFilter filter : {PixelFilter::Box, PixelFilter::Gaussian, PixelFilter::BlackmanHarris}) {
    Settings settings = bdptSettings(48, 40, 64);
    settings.filter = filter;
    if (filter == PixelFilter::Box) settings.crop = PixelWindow{5, 9, 40, 33};
    checkAgreement("orthographic, filter " + std::to_string(static_cast<int>(filter)), scene, settings, 256);
  }
}

TEST_CASE("bdpt equals pt with glossy metals and interpolated normals") {
  SceneData data = glossyBox();
  TriangleMesh sphere;
  addSphere(sphere, {0, -0.4f, 0.2f}, 0.3f, 2);  // coarse, so that shading and geometric normals differ
  data.materials.push_back(data.materials[0]);
  data.materials.back().metallic = 0;
  data.materials.back().roughness = 0.5f;
  addMesh(data, std::move(sphere), static_cast<uint32_t>(data.materials.size() - 1));
  checkAgreement("glossy", Scene(std::move(data)), bdptSettings(48, 48, 256), 1024);
}

TEST_CASE("bdpt equals pt for point, spot and directional lights, also where a path is one bounce long") {
  for (const PunctualKind kind : {PunctualKind::Point, PunctualKind::Spot, PunctualKind::Directional}) {
    SceneData data = cornellBox();
    for (Material& m : data.materials) m.emission = Spectrum(0);
    PunctualLight light;
    light.kind = kind;
    light.position = {0.1f, 0.7f, 0.1f};
    light.direction = glm::normalize(Vec3(0.2f, -0.9f, -0.4f));
    light.outerConeAngle = 0.8f;
    light.innerConeAngle = 0.3f;
    light.intensity = Spectrum(2, 1.5f, 1);
    data.lights = {light};
    const Scene scene(std::move(data));
    for (const int depth : {2, 8}) {
      Settings settings = bdptSettings(48, 48, 64);
      settings.maxDepth = depth;
      checkAgreement("light kind " + std::to_string(static_cast<int>(kind)) + ", depth " + std::to_string(depth), scene,
                     settings, 256);
    }
  }
}

TEST_CASE("The images of all strategies add up to the whole, and most of them are needed") {
  const Scene scene(cornellBox());
  Settings settings = bdptSettings(40, 30, 16);
  settings.maxDepth = 6;
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  const TransportContext context(scene);
  const std::vector<StrategyImage> images = renderStrategies(context, plan, settings.spp);
  const RenderResult whole = render(scene, settings);
  Rgb<double> sum(40, 30);
  std::map<std::pair<int, int>, double> energy;
  for (const StrategyImage& image : images) {
    CHECK(image.s + image.t - 1 <= settings.maxDepth);
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < sum.size(); ++i) {
        sum[c][i] += static_cast<double>(image.mean[c][i]);
        energy[{image.s, image.t}] += static_cast<double>(image.mean[c][i]);
      }
  }
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < sum.size(); ++i) {
      const double expected = static_cast<double>(whole.image[c][i]);
      CHECK(std::fabs(sum[c][i] - expected) <= 1e-5 * expected + 1e-7);
    }
  // Paths of k segments: s from 0 to k, t from 1 (s > 1) or 2 on.
  for (int k = 2; k <= settings.maxDepth; ++k)
    for (int s = 0; s <= k; ++s) {
      CAPTURE(k);
      CAPTURE(s);
      CHECK(energy[{s, k + 1 - s}] > 0);
    }
}

TEST_CASE("calibration: bdpt's reported variance is true, splats included") {
  const Scene scene(cornellBox());
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
    Settings pilotSettings = clampedSettings(24, 24, 128, SamplerKind::Independent, 1000);
    pilotSettings.integrators = {"bdpt"};
    Calibration calibration(render(scene, pilotSettings));
    for (uint64_t seed = 0; seed < 64; ++seed) {
      Settings settings = clampedSettings(24, 24, 16, sampler, seed);
      settings.integrators = {"bdpt"};
      calibration.add(render(scene, settings));
    }
    const bool independent = sampler == SamplerKind::Independent;
    checkCalibration(calibration, independent ? "bdpt independent" : "bdpt sobol", independent);
  }
}

TEST_CASE("Lights of any power scale the splats and nothing else") {
  const auto image = [](float scale) {
    SceneData data = cornellBox();
    for (Material& m : data.materials) m.emission *= scale;
    return render(std::move(data), bdptSettings(16, 16, 4)).image;
  };
  const Rgb<float> one = image(1);
  for (const int exponent : {-20, 20}) {
    const Rgb<float> other = image(std::ldexp(1.0f, exponent));
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < one.size(); ++i) CHECK(std::ldexp(other[c][i], -exponent) == one[c][i]);
  }
}

TEST_CASE("bdpt copes with tiny lights, hidden lights and a camera inside of glass") {
  SceneData tiny = cornellBox();
  for (Material& m : tiny.materials) m.emission = Spectrum(0);
  tiny.materials.push_back(diffuseMaterial(Spectrum(0)));
  tiny.materials.back().emission = Spectrum(1e6f);
  TriangleMesh lamp;
  addQuad(lamp, {0, 0.5f, 0}, {0.001f, 0, 0}, {0, 0, 0.001f});  // 10⁻⁶ m², facing down or up
  const auto emitter = static_cast<uint32_t>(tiny.materials.size() - 1);
  tiny.materials.back().doubleSided = true;
  addMesh(tiny, std::move(lamp), emitter);
  checkAgreement("tiny light", Scene(std::move(tiny)), bdptSettings(32, 32, 64), 256);

  SceneData boxed = cornellBox();
  TriangleMesh shell;
  addSphere(shell, {0, 0.9f, 0}, 3, 2);
  addMesh(boxed, std::move(shell), 0);  // the camera and the box lie inside, no light comes in
  const RenderResult hidden = render(std::move(boxed), bdptSettings(16, 16, 4));
  CHECK(hidden.rejected == 0);

  SceneData glass = cornellBox();
  Material m = diffuseMaterial(Spectrum(1));
  m.transmission = 1;
  m.specular = 1;
  m.roughness = 0;
  m.ior = 1.5f;
  m.thinWalled = false;
  m.attenuationColor = Spectrum(0.5f, 0.8f, 0.9f);
  m.attenuationDistance = 1;
  glass.materials.push_back(m);
  TriangleMesh ball;
  const Vec3 eye(glass.cameras[0].toWorld[3]);
  addSphere(ball, eye, 0.2f, 4);
  addMesh(glass, std::move(ball), static_cast<uint32_t>(glass.materials.size() - 1));
  checkAgreement("camera inside of glass", Scene(std::move(glass)), bdptSettings(32, 32, 256), 1024);
}

}  // namespace braid::test_bdpt
