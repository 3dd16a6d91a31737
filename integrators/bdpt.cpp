// SPDX-License-Identifier: Apache-2.0
// Bidirectional path tracing; the strategies are in bidirectional.h.
#include <cmath>

#include "integrators/bidirectional.h"
#include "integrators/light_preparation.h"
#include "integrators/registry.h"
#include "integrators/tiles.h"

namespace braid {

namespace {

constexpr uint64_t kEyeStream = 0x62640, kLightStream = 0x62641;

class BidirectionalPathTracer final : public Integrator {
 public:
  const char* name() const override { return "bdpt"; }
  const char* description() const override {
    return "bidirectional path tracing, all connections with the power heuristic";
  }
  bool splats() const override { return true; }
  Applies applies(const SceneTraits& traits) const override { return lightPathsApply(traits); }
  std::shared_ptr<const Preparation> prepare(const TransportContext& context, const Plan&) const override {
    return std::make_shared<LightPreparation>(context);
  }

  bool renderPass(const PassRequest& request, PassTarget& target) const override {
    const Plan& plan = request.plan;
    const LightPreparation::Ref preparation(request);
    target.setSplatFractionBits(preparation->splatFractionBits);
    const PassSampler eyeSampler(plan.settings.sampler, plan.settings.seed, kEyeStream, request.pass);
    const PassSampler lightSampler(plan.settings.sampler, plan.settings.seed, kLightStream, request.pass);
    const LightPaths lights{preparation->emission, lightSampler,
                            static_cast<double>(plan.window.width()) * plan.window.height()};
    const MediaStack cameraMedia = mediaOfCamera(request.context.scene, plan.camera);
    return forEachTile(request, [&](const PixelWindow& tile, std::vector<RecordedRay>*) {
      BidirectionalKernel kernel(request, lights, eyeSampler, cameraMedia, target);
      std::vector<std::pair<int, int>> pixels;
      const auto flush = [&] {
        kernel.render(pixels);
        pixels.clear();
      };
      for (int y = tile.y0; y < tile.y1; ++y)
        for (int x = tile.x0; x < tile.x1; ++x) {
          pixels.emplace_back(x, y);
          if (pixels.size() == kBatch) flush();
        }
      if (!pixels.empty()) flush();
      return TileCounts{static_cast<uint64_t>(tile.width()) * static_cast<uint64_t>(tile.height()), kernel.rayCount(),
                        kernel.shadowRayCount()};
    });
  }
};

}  // namespace

std::unique_ptr<Integrator> make_bdpt() { return std::make_unique<BidirectionalPathTracer>(); }

}  // namespace braid
