// SPDX-License-Identifier: Apache-2.0
// Camera passes over fixed tiles: which pixels a tile holds never depends on the number of threads.
#pragma once

#include <tbb/parallel_for.h>

#include "integrators/path_kernel.h"

namespace braid {

struct TileCounts {
  uint64_t paths = 0, rays = 0, shadowRays = 0;
};

// Calls render(tile, record) for every tile of the plan's window, in full-frame pixels. Returns false when cancelled.
template <class Render>
bool forEachTile(const PassRequest& request, const Render& render) {
  constexpr int kTile = 16;
  const PixelWindow& window = request.plan.window;
  const int columns = (window.width() + kTile - 1) / kTile, rows = (window.height() + kTile - 1) / kTile;
  if (request.record) request.record->resize(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  std::atomic<bool> cancelled{false};
  tbb::parallel_for(0, columns * rows, [&](int i) {
    if (request.cancel && request.cancel->load(std::memory_order_relaxed)) {
      cancelled = true;
      return;
    }
    PixelWindow tile;
    tile.x0 = window.x0 + (i % columns) * kTile;
    tile.y0 = window.y0 + (i / columns) * kTile;
    tile.x1 = std::min(tile.x0 + kTile, window.x1);
    tile.y1 = std::min(tile.y0 + kTile, window.y1);
    const TileCounts counts = render(tile, request.record ? &(*request.record)[static_cast<size_t>(i)] : nullptr);
    if (request.statistics) {
      request.statistics->paths += counts.paths;
      request.statistics->rays += counts.rays;
      request.statistics->shadowRays += counts.shadowRays;
    }
  });
  return !cancelled;
}

// Hands a path's result to the film: clamped only when asked to.
inline void storeSample(const PassRequest& request, int x, int y, const PathSample& sample, PassTarget& target) {
  const Plan& plan = request.plan;
  Spectrum radiance = sample.radiance;
  if (plan.settings.clamp > 0) {
    const float largest = maxComponent(radiance);
    if (largest > plan.settings.clamp) radiance *= plan.settings.clamp / largest;
  }
  const int px = x - plan.window.x0, py = y - plan.window.y0;
  if (!target.add(px, py, radiance) && request.statistics)
    request.statistics->rejectedPixel = static_cast<int64_t>(y) * plan.settings.width + x;
  if (plan.features) target.features(px, py, sample.features);
  if (target.wantsCoverage()) target.coverage(px, py, sample.coverage);
}

}  // namespace braid
