// SPDX-License-Identifier: Apache-2.0
// What filters read beside the colour: not how strong the lights are, and without the dice of paths in glass.
#include <doctest/doctest.h>

#include "tests/integrators/small_renders.h"
#include "tests/support/media.h"
#include "tests/support/render_fixture.h"

namespace braid::test_features {

namespace sr = test::small_renders;

namespace {

Rgb<float> albedoOf(float lights, const std::string& integrator) {
  SceneData data = cornellBox();
  for (Material& m : data.materials) m.emission *= lights;
  const Scene scene(std::move(data));
  const sr::Integrators all = makeIntegrators();
  return sr::render(scene, sr::smallFrame(24, 24, 2, integrator), all).estimates->features->albedo.mean;
}

// A slab of smooth clear glass between the camera and a light wall, a dark wall behind the camera, which the glass
// mirrors, and a lamp above.
SceneData glassBetweenWalls(bool solid) {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.8f)), diffuseMaterial(Spectrum(0.2f)),
                    diffuseMaterial(Spectrum(0), Spectrum(20))};
  TriangleMesh wall, back, lamp;
  addQuad(wall, {-9, -9, -2}, {18, 0, 0}, {0, 18, 0});
  addQuad(back, {-9, -9, 4}, {0, 18, 0}, {18, 0, 0});
  addQuad(lamp, {-1, 6, -1}, {2, 0, 0}, {0, 0, 2});
  addMesh(data, std::move(wall), 0);
  addMesh(data, std::move(back), 1);
  addMesh(data, std::move(lamp), 2);
  Material glass = diffuseMaterial(Spectrum(1));
  glass.transmission = 1;
  glass.roughness = 0;
  glass.specular = 1;
  glass.ior = 1.5f;
  glass.thinWalled = !solid;
  test::addSolid(data, test::boxMesh({-3, -3, 0}, {3, 3, 0.3f}), glass);
  data.cameras = {test::cameraAt({0.2f, 0.1f, 2}, {0, 0, 0})};
  return data;
}

}  // namespace

TEST_CASE("features: glass shows what is most likely seen in it, without noise, and radiance does not know") {
  const sr::Integrators all = makeIntegrators();
  for (const bool solid : {true, false}) {
    const Scene scene(glassBetweenWalls(solid));
    for (const char* integrator : {"pt", "crn", "bdpt", "vcm", "sppm", "gdpt"}) {
      CAPTURE(solid);
      CAPTURE(std::string(integrator));
      Settings settings = sr::smallFrame(16, 16, 8, integrator);
      settings.keep.features = true;
      const RenderResult with = sr::render(scene, settings, all);
      const Features& f = *with.estimates->features;
      for (size_t i = 0; i < f.albedo.mean.size(); ++i) {
        CHECK(f.albedo.mean[1][i] == doctest::Approx(0.8f));
        CHECK(f.albedo.variance[1][i] < 1e-12f);
        CHECK(f.normal.mean[2][i] == doctest::Approx(1));
      }
      settings.keep.features = false;
      CHECK(sr::sameBits(with.estimates->estimates[0].mean,
                         sr::render(scene, settings, all).estimates->estimates[0].mean));
    }
  }
}

TEST_CASE("features: at grazing angles glass is a mirror, and what it mirrors is seen") {
  SceneData data = glassBetweenWalls(true);
  data.cameras = {test::cameraAt({-2.9f, 0, 0.5f}, {0, 0, 0.3f})};
  TriangleMesh side;
  addQuad(side, {8, -9, -2}, {0, 18, 0}, {0, 0, 6});
  addMesh(data, std::move(side), 1);
  const Scene scene(std::move(data));
  Settings settings = sr::smallFrame(8, 8, 8, "pt");
  settings.keep.features = true;
  const RenderResult r = sr::render(scene, settings, makeIntegrators());
  CHECK(r.estimates->features->albedo.mean[1].at(4, 4) == doctest::Approx(0.2f));
}

TEST_CASE("features: what shines is white, however brightly") {
  for (const char* integrator : {"pt", "bdpt"}) {
    const Rgb<float> albedo = albedoOf(1, integrator);
    int white = 0;
    for (size_t i = 0; i < albedo.size(); ++i) white += albedo[0][i] == 1 && albedo[1][i] == 1 && albedo[2][i] == 1;
    CHECK(white > 0);
    for (const float lights : {1e-12f, 1e-3f, 1e12f}) CHECK(sr::sameBits(albedo, albedoOf(lights, integrator)));
  }
}

}  // namespace braid::test_features
