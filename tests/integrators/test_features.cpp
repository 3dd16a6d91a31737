// SPDX-License-Identifier: Apache-2.0
// What filters read beside the colour does not depend on how strong the lights are.
#include <doctest/doctest.h>

#include "tests/integrators/small_renders.h"
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

}  // namespace

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
