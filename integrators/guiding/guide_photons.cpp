// SPDX-License-Identifier: Apache-2.0
#include "integrators/guiding/guide_photons.h"

#include "renderer/core/parallel.h"
#include "renderer/transport/light_emission.h"
#include "renderer/transport/subpath.h"

namespace braid {

namespace {

constexpr uint64_t kStream = 0x677068;
constexpr size_t kPaths = size_t(1) << 16;
constexpr size_t kMostOfPath = kMostGuidePhotons / kPaths;  // later ones tell little

class PhotonWalks {
 public:
  PhotonWalks(const TransportContext& context, const Plan& plan)
      : context_(context),
        emission_(context.scene, context.lights),
        sampler_(SamplerKind::Independent, plan.settings.seed, kStream, 0) {
    walk_.transport = Transport::Power;
    walk_.maxSegments = plan.settings.maxDepth - 1;  // one more leads to the camera
    walk_.roulette = {1, 1};                         // photons of like power
    walk_.mis = false;
  }
  bool empty() const { return emission_.empty(); }

  // The subpaths of a batch, the first of which is `first`.
  void follow(size_t first, std::vector<GuidePhoton>& out) const {
    SubpathBatch batch(context_, sampler_, walk_);
    for (size_t item = first; item < first + kBatch; ++item) start(item, batch);
    std::array<size_t, kBatch> stored{};
    batch.run(
        [&](int i, const SubpathState&, const SubpathVertex& vertex) {
          size_t& count = stored[static_cast<size_t>(i)];
          if (!(vertex.segments > 1 && vertex.bsdf.hasNonDelta() && !vertex.woBelow)) return Onward::Scatter;
          if (count++ == kMostOfPath) return Onward::End;
          const int surface = guideClass(vertex.hit.ng, GuidedBsdf::isNarrow(vertex.bsdf));
          const float power = average(vertex.throughput);
          if (power > 0 && std::isfinite(power))
            out.push_back({vertex.hit.position, squareOfDirection(toGuideAxes(surface, vertex.hit.wo)), power,
                           static_cast<uint32_t>(surface)});
          return Onward::Scatter;
        },
        [](int, const SubpathState&) {});
  }

 private:
  void start(size_t item, SubpathBatch& batch) const {
    const uint64_t key = sampler_.itemKey(item);
    const SampleBlock u = sampler_.block(key, 1);
    const double select =
        (static_cast<double>(item) + static_cast<double>(u.u[slot::kLightSelect])) / static_cast<double>(kPaths);
    batch.startLight(key, emission_, select, u, context_.scene.timeAt(u.u[slot::kExtra]));
  }

  const TransportContext& context_;
  const LightEmission emission_;
  const PassSampler sampler_;
  WalkSettings walk_;
};

}  // namespace

std::vector<GuidePhoton> traceGuidePhotons(const TransportContext& context, const Plan& plan) {
  const PhotonWalks walks(context, plan);
  std::vector<GuidePhoton> photons;
  if (walks.empty()) return photons;
  static_assert(kPaths % kBatch == 0);
  std::vector<std::vector<GuidePhoton>> found(kPaths / kBatch);
  parallelFor(found.size(), [&](size_t i) { walks.follow(i * kBatch, found[i]); });
  for (const std::vector<GuidePhoton>& f : found) photons.insert(photons.end(), f.begin(), f.end());
  return photons;
}

}  // namespace braid
