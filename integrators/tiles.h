// SPDX-License-Identifier: Apache-2.0
// Camera passes over fixed tiles: which pixels a tile holds never depends on the number of threads.
#pragma once

#include "integrators/path_kernel.h"
#include "renderer/core/parallel.h"

namespace braid {

struct TileCounts {
  uint64_t paths = 0, rays = 0, shadowRays = 0, photons = 0;
};

// Calls render(tile, record) for every tile of the plan's window, in full-frame pixels. Returns false when cancelled.
template <class Render>
bool forEachTile(const PassRequest& request, const Render& render) {
  constexpr int kTile = 16;
  const PixelWindow& window = request.plan.window;
  const int columns = (window.width() + kTile - 1) / kTile, rows = (window.height() + kTile - 1) / kTile;
  if (request.record) request.record->resize(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  std::atomic<bool> cancelled{false};
  parallelFor(static_cast<size_t>(columns) * static_cast<size_t>(rows), [&](size_t index) {
    const int i = static_cast<int>(index);
    if (request.cancel && request.cancel->load(std::memory_order_relaxed)) {
      cancelled = true;
      return;
    }
    PixelWindow tile;
    tile.x0 = window.x0 + (i % columns) * kTile;
    tile.y0 = window.y0 + (i / columns) * kTile;
    tile.x1 = std::min(tile.x0 + kTile, window.x1);
    tile.y1 = std::min(tile.y0 + kTile, window.y1);
    const TileCounts counts = render(tile, request.record ? &(*request.record)[index] : nullptr);
    if (request.statistics) {
      request.statistics->paths += counts.paths;
      request.statistics->rays += counts.rays;
      request.statistics->shadowRays += counts.shadowRays;
      request.statistics->photons += counts.photons;
    }
  });
  return !cancelled;
}

// Calls start(i, x, y) for up to kBatch pixels of the tile, full-frame coordinates and i from 0, then finish() and
// store(i, x, y) for the same pixels, until the tile is done.
template <class Start, class Finish, class Store>
void forEachBatch(const PixelWindow& tile, const Start& start, const Finish& finish, const Store& store) {
  const int width = tile.width(), pixels = width * tile.height();
  for (int first = 0; first < pixels; first += kBatch) {
    const int last = std::min(pixels, first + kBatch);
    for (int p = first; p < last; ++p) start(p - first, tile.x0 + p % width, tile.y0 + p / width);
    finish();
    for (int p = first; p < last; ++p) store(p - first, tile.x0 + p % width, tile.y0 + p / width);
  }
}

inline uint64_t pixelCount(const PixelWindow& w) {
  return static_cast<uint64_t>(w.width()) * static_cast<uint64_t>(w.height());
}

// What of the light that would reach an open ground does not reach this point of it: the alpha of black shadows.
inline float shadowOf(const PassRequest& request, const PathSample& sample) {
  return 1 - average(sample.radiance) / average(*request.context.scene.data().ground);
}

// Hands a path's result to the film: clamped only when asked to.
inline void storeSample(const PassRequest& request, int x, int y, const PathSample& sample, PassTarget& target) {
  const Plan& plan = request.plan;
  Spectrum radiance = sample.radiance, direct = sample.direct;
  const bool catches = sample.onGround && plan.settings.transparent;
  if (catches) radiance = direct = Spectrum(0);
  if (plan.settings.clamp > 0) {
    const float largest = maxComponent(radiance);
    if (largest > plan.settings.clamp) {
      radiance *= plan.settings.clamp / largest;
      direct *= plan.settings.clamp / largest;
    }
  }
  const int px = x - plan.window.x0, py = y - plan.window.y0;
  if (!target.add(px, py, radiance) && request.statistics)
    request.statistics->rejectedPixel = static_cast<int64_t>(y) * plan.settings.width + x;
  if (target.wantsDirect()) target.direct(px, py, direct);
  if (plan.kept.features) target.features(px, py, sample.features);
  if (target.wantsCoverage()) target.coverage(px, py, catches ? shadowOf(request, sample) : sample.coverage);
}

// What is found by a camera path through every pixel of a tile goes to the film.
inline void renderTile(const Integrator& integrator, const PassRequest& request, const PassSampler& sampler,
                       const PixelWindow& tile, PathKernel& kernel, PassTarget& target) {
  forEachBatch(
      tile,
      [&](int i, int x, int y) {
        if (i == 0) kernel.clear();
        kernel.start(x, y, integrator.pixelKey(sampler, request.plan, x, y));
      },
      [&] { kernel.run(); }, [&](int i, int x, int y) { storeSample(request, x, y, kernel.sample(i), target); });
}

// The points of a pass: of the paths from the camera, and of the branches that they are split into.
class PathPoints {
 public:
  PathPoints(const Integrator& integrator, const Plan& plan, uint64_t pass, int splits)
      : camera_(integrator.pixelSampler(plan, pass)) {
    if (splits == 1 || plan.settings.sampler != SamplerKind::Sobol) return;
    const auto n = static_cast<uint64_t>(splits);
    for (uint64_t k = 0; k < n; ++k) branches_.push_back(*integrator.pixelSampler(plan, branchPass(pass, k, n)));
  }
  const PassSampler& camera() const { return *camera_; }
  PathAids with(PathAids aids) const {
    aids.branches = branches_;
    return aids;
  }

 private:
  std::unique_ptr<PassSampler> camera_;
  std::vector<PassSampler> branches_;
};

// The same of the tiles that request.tiles names.
bool renderPlacedTiles(const Integrator& integrator, const PassRequest& request, PassTarget& target,
                       const PathAids& aids);

// A pass of one camera path for every pixel, followed by the path kernel with the integrator's random numbers and
// roulette. Returns false when cancelled.
inline bool renderCameraPaths(const Integrator& integrator, const PassRequest& request, PassTarget& target,
                              const PathAids& aids = {}) {
  if (request.tiles) return renderPlacedTiles(integrator, request, target, aids);
  const Plan& plan = request.plan;
  const PathPoints points(integrator, plan, request.pass, aids.splits);
  return forEachTile(request, [&](const PixelWindow& tile, std::vector<RecordedRay>* record) {
    PathKernel kernel(request.context, plan, points.camera(), record, integrator.roulette());
    kernel.use(points.with(aids));
    renderTile(integrator, request, points.camera(), tile, kernel, target);
    return TileCounts{pixelCount(tile), kernel.rayCount, kernel.shadowRayCount};
  });
}

}  // namespace braid
