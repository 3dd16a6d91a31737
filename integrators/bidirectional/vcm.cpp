// SPDX-License-Identifier: Apache-2.0
// Vertex connection and merging: bidirectional path tracing that also merges eye vertices with the light vertices of
// the whole pass that lie near them (integrators/README.md, Vertex connection and merging). Consistent, not unbiased.
//
// A pass traces its light subpaths twice, once for the grid and once, with the same random numbers, beside the eye
// subpath that connects to them: full vertices of a whole frame would take ten times the memory.
#include <algorithm>
#include <cmath>

#include "integrators/bidirectional/bidirectional.h"
#include "integrators/light_preparation.h"
#include "integrators/registry.h"
#include "integrators/tiles.h"
#include "renderer/core/parallel.h"
#include "renderer/session/path_time.h"

namespace braid {

namespace {

constexpr uint64_t kEyeStream = 0x76636d0, kLightStream = 0x76636d1;
constexpr double kAlpha = 0.75;  // radii shrink by k^(-(1-α)/2), k counting rounds of four passes
constexpr size_t kChunk = 4096;  // light subpaths

struct MergePreparation final : LightPreparation {
  MergePreparation(const TransportContext& context, const Plan& plan)
      : LightPreparation(context), firstRadius(footprintRadius(context.scene, plan)) {}
  float firstRadius;  // metres

  // Twice the median size of a pixel where camera rays arrive, at most 1 % and at least 10⁻⁶ of the scene's radius.
  static float footprintRadius(const Scene& scene, const Plan& plan) {
    constexpr int kGrid = 24;
    std::vector<float> sizes;
    const PixelWindow& w = plan.window;
    for (int j = 0; j < kGrid; ++j)
      for (int i = 0; i < kGrid; ++i) {
        const Vec2 raster(
            static_cast<float>(w.x0) + (static_cast<float>(i) + 0.5f) / kGrid * static_cast<float>(w.width()),
            static_cast<float>(w.y0) + (static_cast<float>(j) + 0.5f) / kGrid * static_cast<float>(w.height()));
        const Camera::CameraRay r = plan.camera.ray(raster);
        RayBatch batch;
        RayHit hit;
        batch.set(0, {r.origin, r.direction, kInfinity, kCameraRay});
        scene.accel().intersect(batch, 1, &hit);
        if (!(hit.t < kInfinity)) continue;
        const double distance = plan.camera.orthographic() ? 1.0 : static_cast<double>(hit.t);
        sizes.push_back(static_cast<float>(distance / std::sqrt(plan.camera.pixelPdf(r.direction))));
      }
    const float radius = scene.traits().radius;
    if (sizes.empty()) return 0.003f * radius;
    std::nth_element(sizes.begin(), sizes.begin() + static_cast<ptrdiff_t>(sizes.size() / 2), sizes.end());
    return std::clamp(2 * sizes[sizes.size() / 2], 1e-6f * radius, 0.01f * radius);
  }
};

class VertexConnectionAndMerging final : public Integrator {
 public:
  const char* name() const override { return "vcm"; }
  const char* description() const override { return "vertex connection and merging, with shrinking radii"; }
  bool unbiased() const override { return false; }
  bool splats() const override { return true; }
  bool passesAreInstants() const override { return true; }
  Applies applies(const SceneTraits&, const LightReach&) const override {
    return {false, "weighs all its paths into one image, which leaves combiners nothing to choose: on request only"};
  }
  WorkingMemory workingMemory(const Plan& plan) const override {
    // Light subpaths of a dozen vertices would be unusual; Russian roulette ends most after three.
    const uint64_t pixels = static_cast<uint64_t>(plan.window.width()) * static_cast<uint64_t>(plan.window.height());
    return {pixels * 4 * 2 * sizeof(MergeVertex), "for light vertices, four for every pixel"};
  }
  std::shared_ptr<const Preparation> prepare(const TransportContext& context, const Plan& plan) const override {
    return std::make_shared<MergePreparation>(context, plan);
  }

  bool renderPass(const PassRequest& request, PassTarget& target) const override {
    const Plan& plan = request.plan;
    std::unique_ptr<const MergePreparation> own;
    const auto* preparation = dynamic_cast<const MergePreparation*>(request.preparation);
    if (!preparation) {
      own = std::make_unique<MergePreparation>(request.context, plan);
      preparation = own.get();
    }
    target.setSplatFractionBits(preparation->splatFractionBits);
    const PassSampler eyeSampler(plan.settings.sampler, plan.settings.seed, kEyeStream, request.pass);
    const PassSampler lightSampler(plan.settings.sampler, plan.settings.seed, kLightStream, request.pass);
    const LightPaths lights{preparation->emission, lightSampler,
                            static_cast<double>(plan.window.width()) * static_cast<double>(plan.window.height())};
    const double round = static_cast<double>(request.pass / kSequenceBuckets) + 1;
    const float radius = preparation->firstRadius * static_cast<float>(std::pow(round, -0.5 * (1 - kAlpha)));
    const double eta = static_cast<double>(kPi) * sqr(static_cast<double>(radius)) * lights.count;
    Merging merging{nullptr, sqr(1 / eta), sqr(eta), static_cast<float>(1 / eta)};

    const float time = passTime(request.context.scene, eyeSampler);
    std::vector<MergeVertex> vertices;
    if (!traceLightPaths(request, lights, merging, time, vertices)) return false;
    const MergeGrid grid(std::move(vertices), radius);
    merging.grid = &grid;
    const MediaStack cameraMedia = mediaOfCamera(request.context.scene, plan.camera, time);
    return forEachTile(request, [&](const PixelWindow& tile, std::vector<RecordedRay>*) {
      BidirectionalKernel kernel(request, {lights, eyeSampler, cameraMedia, &merging, time}, target);
      renderTile(kernel, tile);
      return TileCounts{pixelCount(tile), kernel.rayCount(), kernel.shadowRayCount()};
    });
  }

 private:
  // The light vertices of the pass in the order of their subpaths; false when cancelled.
  static bool traceLightPaths(const PassRequest& request, const LightPaths& lights, const Merging& merging, float time,
                              std::vector<MergeVertex>& vertices) {
    const PixelWindow& w = request.plan.window;
    const auto width = static_cast<size_t>(w.width()), count = width * static_cast<size_t>(w.height());
    std::vector<std::vector<MergeVertex>> chunks((count + kChunk - 1) / kChunk);
    std::atomic<bool> cancelled{false};
    parallelChunks(count, kChunk, [&](size_t begin, size_t end) {
      if (request.cancel && request.cancel->load(std::memory_order_relaxed)) cancelled = true;
      if (cancelled) return;
      std::vector<MergeVertex>& out = chunks[begin / kChunk];
      SubpathBatch batch(request.context, lights.sampler, bidirectionalWalk(request.plan, Transport::Power, &merging));
      for (size_t first = begin; first < end; first += kBatch) {
        batch.clear();
        for (size_t i = first; i < std::min(end, first + kBatch); ++i)
          lights.start(batch,
                       pixelItem(request.plan, w.x0 + static_cast<int>(i % width), w.y0 + static_cast<int>(i / width)),
                       time);
        batch.run(
            [&](int, const SubpathState&, const SubpathVertex& v) {
              if (!v.woBelow && v.bsdf.hasNonDelta())
                out.push_back({v.hit.position, v.hit.wo, v.throughput, std::abs(glm::dot(v.hit.wo, v.hit.ng)),
                               v.segments, v.mis});
              return Onward::Scatter;
            },
            [](int, const SubpathState&) {});
      }
    });
    if (cancelled) return false;
    size_t total = 0;
    for (const auto& chunk : chunks) total += chunk.size();
    vertices.reserve(total);
    for (const auto& chunk : chunks) vertices.insert(vertices.end(), chunk.begin(), chunk.end());
    return true;
  }
};

}  // namespace

std::unique_ptr<Integrator> make_vcm() { return std::make_unique<VertexConnectionAndMerging>(); }

}  // namespace braid
