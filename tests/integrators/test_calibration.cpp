// SPDX-License-Identifier: Apache-2.0
// The reported variance of path tracing, and of its direct and indirect light; how it is measured: calibration.h.
#include "combiners/statistics/direct_indirect.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/statistics/calibration.h"

namespace braid::test_calibration {

using namespace test;

namespace {

void checkScene(const std::string& name, const Scene& scene, int width, int height, uint64_t seeds) {
  const Settings pilotSettings = clampedSettings(width, height, 256, SamplerKind::Independent, 1000);
  const RenderResult pilot = render(scene, pilotSettings);
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol})
    for (const uint64_t spp : {4, 16, 64}) {
      Calibration calibration(pilot);
      for (uint64_t seed = 0; seed < seeds; ++seed)
        calibration.add(render(scene, clampedSettings(width, height, spp, sampler, seed)));
      const bool independent = sampler == SamplerKind::Independent;
      checkCalibration(calibration, name + (independent ? " independent " : " sobol ") + std::to_string(spp) + " spp",
                       independent);
    }
}

using Part = Estimate (*)(const Estimate&);

void checkParts(const std::string& name, const Scene& scene, uint64_t seeds) {
  const auto rendered = [&](uint64_t spp, SamplerKind sampler, uint64_t seed) {
    Settings settings = clampedSettings(24, 24, spp, sampler, seed);
    settings.keep.directIndirect = settings.keep.quarters = true;
    return render(scene, settings);
  };
  const RenderResult pilot = rendered(256, SamplerKind::Independent, 1000);
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
    std::vector<RenderResult> results;
    for (uint64_t seed = 0; seed < seeds; ++seed) results.push_back(rendered(16, sampler, seed));
    const bool independent = sampler == SamplerKind::Independent;
    for (const auto& [part, what] :
         {std::pair<Part, const char*>{directLight, "direct"}, {indirectLight, "indirect"}}) {
      Calibration calibration(part(estimateOf(pilot)));
      for (const RenderResult& r : results) calibration.add(part(estimateOf(r)));
      checkVariance(calibration, name + ", " + what + (independent ? " independent" : " sobol"), independent);
    }
  }
}

}  // namespace

TEST_CASE("calibration: reported variances of direct and of indirect light are true on the Cornell box") {
  checkParts("cornell", Scene(cornellBox()), 192);
}

TEST_CASE("calibration: reported variance is true on the Cornell box") {
  checkScene("cornell", Scene(cornellBox()), 24, 24, 64);
}

TEST_CASE("calibration: reported variance is true on plates") {
  checkScene("plates", Scene(loadGltf(sourcePath("scenes/plates.glb"))), 24, 16, 96);
}

TEST_CASE("calibration: reported variance is true on an interior") {
  checkScene("interior", Scene(loadGltf(sourcePath("scenes/interior.glb"))), 24, 16, 64);
}

}  // namespace braid::test_calibration
