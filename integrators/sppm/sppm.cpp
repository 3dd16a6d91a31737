// SPDX-License-Identifier: Apache-2.0
// Stochastic progressive photon mapping with radii that depend on the pass alone: each pass is an independent estimate
// with its own radius, and the mean over passes equals the classic recursion (integrators/README.md, Photon mapping).
// Passes estimate their bias by comparing two radii (integrators/README.md, Bias of photon maps).
#include <fmt/format.h>

#include "integrators/light_preparation.h"
#include "integrators/registry.h"
#include "integrators/sppm/sppm_eye.h"
#include "integrators/sppm/sppm_gather.h"
#include "integrators/sppm/sppm_preparation.h"
#include "integrators/tiles.h"
#include "renderer/session/path_time.h"

namespace braid {

namespace {

constexpr uint64_t kEyeStream = 0x73707000, kLightStream = 0x73707001;

class PhotonMapper final : public Integrator {
 public:
  const char* name() const override { return "sppm"; }
  const char* description() const override {
    return "stochastic progressive photon mapping, direct light by next-event estimation";
  }
  bool unbiased() const override { return false; }
  bool estimatesBias() const override { return true; }
  bool passesAreInstants() const override { return true; }
  Applies applies(const SceneTraits& traits, const LightReach& reach) const override {
    return photonsApply(traits, reach);
  }

  WorkingMemory workingMemory(const Plan& plan) const override {
    const uint64_t paths = photonPaths(plan);
    const auto stored = static_cast<uint64_t>(kStoredPerPath * static_cast<double>(paths));
    return {CausticGrid::bytesWhileBuilding(stored),
            fmt::format("for the photons of {} light paths a pass, {} kept of each on average at most; first radius {} "
                        "pixels, direct light by {}, lights chosen by power{}",
                        paths, kStoredPerPath, plan.settings.photonRadius,
                        plan.settings.photonDirect ? "photons" : "next-event estimation",
                        plan.settings.photonAiming ? " and by whether their photons arrive in view" : "")};
  }

  std::shared_ptr<const Preparation> prepare(const TransportContext& context, const Plan& plan) const override {
    return std::make_shared<PhotonPreparation>(context, plan);
  }

  bool renderPass(const PassRequest& request, PassTarget& target) const override;
};

bool PhotonMapper::renderPass(const PassRequest& request, PassTarget& target) const {
  const Plan& plan = request.plan;
  const PhotonPreparation::Ref preparation(request);
  const PassSampler lightSampler(plan.settings.sampler, plan.settings.seed, kLightStream, request.pass);
  const PassSampler eyeSampler(plan.settings.sampler, plan.settings.seed, kEyeStream, request.pass);
  const uint64_t paths = photonPaths(plan);
  const float time = passTime(request.context.scene, eyeSampler);
  TracedPhotons traced;
  if (plan.settings.maxDepth > 1 && !preparation->emission().empty() &&
      !tracePhotons(request.context, {preparation->emission(), lightSampler, paths, time}, plan.settings,
                    preparation->keep(), request.cancel, traced))
    return false;
  if (request.statistics) request.statistics->rays += traced.segments;
  const RadiusScale radii = gatherRadii(plan, request.context.scene.traits(), request.pass, time);
  const PhotonGrid grid(std::move(traced.photons), radii);
  const CausticGrid causticGrid(std::move(traced.caustics), radii);
  const auto lightPaths = static_cast<double>(paths);
  const CausticMerging caustics{causticGrid, preparation->emission(), lightPaths, preparation->keep()};
  const bool merges = mergesCaustics(request.context.scene, plan.settings.maxDepth);
  const MediaStack cameraMedia = mediaOfCamera(request.context.scene, plan.camera, time);

  return forEachTile(request, [&](const PixelWindow& tile, std::vector<RecordedRay>*) {
    PhotonEyeBatch batch(request.context, plan, eyeSampler, cameraMedia, merges ? &caustics : nullptr, time);
    forEachBatch(
        tile,
        [&](int i, int x, int y) {
          if (i == 0) batch.clear();
          batch.start(x, y, pixelKey(eyeSampler, plan, x, y));
        },
        [&] {
          batch.run([&](int i, const SubpathVertex& vertex) {
            const float radius = radii.radiusAt(vertex.hit.position, vertex.travelled);
            const int maxSegments = plan.settings.maxDepth - vertex.segments;
            batch.addGathered(i, vertex, gatherPhotons(grid, vertex, radius, maxSegments), lightPaths, radius);
          });
        },
        [&](int i, int x, int y) {
          const PathSample& sample = batch.sample(i);
          storeSample(request, x, y, sample, target);
          if (!target.wantsBias()) return;
          const float largest = maxComponent(sample.radiance), clamp = plan.settings.clamp;
          const float scale = clamp > 0 && largest > clamp ? clamp / largest : 1.0f;
          target.bias(x - plan.window.x0, y - plan.window.y0, batch.bias(i) * scale);
        });
    return TileCounts{pixelCount(tile), batch.rayCount(), batch.shadowRayCount, batch.photonCount};
  });
}

}  // namespace

std::unique_ptr<Integrator> make_sppm() { return std::make_unique<PhotonMapper>(); }

}  // namespace braid
