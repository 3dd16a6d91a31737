// SPDX-License-Identifier: Apache-2.0
// Bidirectional path tracing; the strategies are in bidirectional.h.
#include "integrators/bidirectional/bidirectional.h"
#include "integrators/light_preparation.h"
#include "integrators/registry.h"
#include "integrators/bidirectional/strategies.h"
#include "integrators/tiles.h"

namespace braid {

namespace {

constexpr uint64_t kEyeStream = 0x62640, kLightStream = 0x62641;

// What the batches of a pass share.
struct Pass {
  LightPreparation::Ref preparation;
  PassSampler eyeSampler, lightSampler;
  LightPaths lights;
  MediaStack cameraMedia;

  explicit Pass(const PassRequest& r)
      : preparation(r),
        eyeSampler(r.plan.settings.sampler, r.plan.settings.seed, kEyeStream, r.pass),
        lightSampler(r.plan.settings.sampler, r.plan.settings.seed, kLightStream, r.pass),
        lights{preparation->emission, lightSampler,
               static_cast<double>(r.plan.window.width()) * static_cast<double>(r.plan.window.height())},
        cameraMedia(mediaOfCamera(r.context.scene, r.plan.camera)) {}
  BidirectionalPass shared() const { return {lights, eyeSampler, cameraMedia}; }
};

class BidirectionalPathTracer final : public Integrator {
 public:
  const char* name() const override { return "bdpt"; }
  const char* description() const override {
    return "bidirectional path tracing, all connections with the power heuristic";
  }
  bool splats() const override { return true; }
  Applies applies(const SceneTraits& traits, const LightReach& reach) const override {
    return connectionsApply(traits, reach);
  }
  double misses(const LightReach& reach) const override { return reach.beyondConnections; }
  std::shared_ptr<const Preparation> prepare(const TransportContext& context, const Plan&) const override {
    return std::make_shared<LightPreparation>(context);
  }

  bool renderPass(const PassRequest& request, PassTarget& target) const override {
    return renderBidirectionalPass(request, target, nullptr);
  }
};

}  // namespace

bool renderBidirectionalPass(const PassRequest& request, PassTarget& target, StrategyObserver* observer) {
  const Pass pass(request);
  target.setSplatFractionBits(pass.preparation->splatFractionBits);
  return forEachTile(request, [&](const PixelWindow& tile, std::vector<RecordedRay>*) {
    BidirectionalKernel kernel(request, pass.shared(), target, observer);
    renderTile(kernel, tile);
    return TileCounts{pixelCount(tile), kernel.rayCount(), kernel.shadowRayCount()};
  });
}

void replayBidirectionalPixel(const PassRequest& request, int x, int y, StrategyObserver& observer) {
  const Pass pass(request);
  const PixelWindow& w = request.plan.window;
  PassTarget target(
      w.width(), w.height(),
      {.splats = true, .features = request.plan.kept.features, .coverage = request.plan.settings.transparent});
  BidirectionalKernel(request, pass.shared(), target, &observer).render({{x, y}});
}

std::unique_ptr<Integrator> make_bdpt() { return std::make_unique<BidirectionalPathTracer>(); }

}  // namespace braid
