// SPDX-License-Identifier: Apache-2.0
// Path tracing with common random numbers: in one pass all pixels use the same variate in every structural dimension,
// the position within the pixel and stochastic coverage included (integrators/README.md, Common random numbers).
//
// Passes are independent whatever sampler the settings ask for: the film corrects the variance of low-discrepancy
// passes over a window of pixels, which all have one and the same error here. Russian roulette with a shared variate
// ends whole regions of paths along an edge that is not in the scene; it therefore starts late and keeps paths longer.
#include "integrators/path_kernel.h"
#include "integrators/registry.h"
#include "integrators/tiles.h"

namespace braid {

namespace {

constexpr uint64_t kStream = 0x63726e;
constexpr Roulette kLateRoulette{8, 0.1f};

class CommonRandomNumbers final : public Integrator {
 public:
  const char* name() const override { return "crn"; }
  const char* description() const override {
    return "path tracing with the same random numbers in every pixel, for uncorrelated weighting";
  }
  Correlation correlation() const override { return Correlation::CommonRandomNumbers; }
  bool lowDiscrepancy(const Settings&) const override { return false; }
  Roulette roulette() const override { return kLateRoulette; }
  Applies applies(const SceneTraits&, const LightReach&) const override {
    return {false, "pixels share their errors: only for uncorrelated weighting, when named"};
  }
  double misses(const LightReach& reach) const override { return reach.beyondCameraPaths; }

  std::unique_ptr<PassSampler> pixelSampler(const Plan& plan, uint64_t pass) const override {
    return std::make_unique<PassSampler>(SamplerKind::Independent, plan.settings.seed, kStream, pass);
  }
  uint64_t pixelKey(const PassSampler& sampler, const Plan&, int, int) const override { return sampler.itemKey(0); }

  bool renderPass(const PassRequest& request, PassTarget& target) const override {
    return renderCameraPaths(*this, request, target);
  }
};

}  // namespace

std::unique_ptr<Integrator> make_crn() { return std::make_unique<CommonRandomNumbers>(); }

}  // namespace braid
