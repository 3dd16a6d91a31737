// SPDX-License-Identifier: Apache-2.0
// Path tracing: one camera path per pixel and pass, random numbers of its own for every pixel.
#include "integrators/light_preparation.h"
#include "integrators/path_preparation.h"
#include "integrators/registry.h"
#include "integrators/tiles.h"

namespace braid {

namespace {

constexpr uint64_t kStream = 0x7074;

class PathTracer final : public Integrator {
 public:
  const char* name() const override { return "pt"; }
  const char* description() const override {
    return "path tracing, next-event estimation and BSDF sampling with the power heuristic";
  }
  Applies applies(const SceneTraits& traits, const LightReach& reach) const override {
    if (connectionsApply(traits, reach).yes) return {false, "bdpt has all its ways to find light, and more", true};
    return {true, "unbiased for every scene", photonsApply(traits, reach).open};
  }
  double misses(const LightReach& reach) const override { return reach.beyondCameraPaths; }

  bool separatesDirectLight() const override { return true; }
  bool placesSamples() const override { return true; }

  std::shared_ptr<const Preparation> prepare(const TransportContext& context, const Plan& plan) const override {
    return std::make_shared<PathPreparation>(context, plan);
  }
  std::vector<PlanLine> planLines(const Plan& plan) const override {
    const Applies guiding = guidingApplies(plan), samples = lightSamplesMeasured(plan),
                  splits = pathSplitsMeasured(plan);
    return {{guiding.yes, "path guiding",
             guiding.yes && guiding.reason.empty() ? "learned before the first pass, and used where it pays"
                                                   : guiding.reason},
            {samples.yes || plan.settings.lightSamples > 0, "light samples", samples.reason},
            {splits.yes || plan.settings.pathSplits > 1, "path splits", splits.reason}};
  }
  WorkingMemory workingMemory(const Plan& plan) const override {
    if (!guidingApplies(plan).yes) return {};
    return {guidingBytes(plan), "while the guide of paths is learned"};
  }

  std::unique_ptr<PassSampler> pixelSampler(const Plan& plan, uint64_t pass) const override {
    return std::make_unique<PassSampler>(plan.settings.sampler, plan.settings.seed, kStream, pass);
  }

  bool renderPass(const PassRequest& request, PassTarget& target) const override {
    return renderCameraPaths(*this, request, target, PathPreparation::Ref(request)->aids());
  }
};

}  // namespace

std::unique_ptr<Integrator> make_pt() { return std::make_unique<PathTracer>(); }

}  // namespace braid
