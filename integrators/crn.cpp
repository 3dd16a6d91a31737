// SPDX-License-Identifier: Apache-2.0
// Path tracing with common random numbers: in one pass all pixels use the same variate in every structural dimension,
// the position within the pixel and stochastic coverage included. The error of a pass is then nearly the same in
// neighbouring pixels and cancels in their differences, which is what uncorrelated weighting feeds on (Back et al.
// 2023, "Input-Dependent Uncorrelated Weighting for Monte Carlo Denoising", section 3).
//
// Passes are independent whatever sampler the settings ask for. The film corrects the variance of low-discrepancy
// passes by the spread of the bucket means over a window of pixels; here all pixels of that window have one and the
// same error, so that two buckets would leave a single degree of freedom. Over independent passes the variance of each
// pixel is true by itself, and sub-averages are identically distributed, as the weights assume (theorem 2).
//
// Russian roulette with a shared variate would end whole regions of paths along a line of equal throughput: an edge
// that is not in the scene. It therefore starts late and keeps paths at half of the throughput that the path tracer
// keeps them at: so large is the step at such an edge, and so much less is the error that all pixels share.
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
