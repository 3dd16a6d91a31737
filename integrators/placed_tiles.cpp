// SPDX-License-Identifier: Apache-2.0
// Passes that render some tiles only.
#include <algorithm>
#include <map>

#include "integrators/tiles.h"

namespace braid {

namespace {

constexpr size_t kTogether = 4;  // tiles of one kernel

// Tiles that share their random numbers' pass.
struct Group {
  const PathPoints* points;
  std::vector<size_t> tiles;
};

using Points = std::map<uint64_t, std::unique_ptr<PathPoints>>;

std::vector<Group> groupsOf(const Integrator& integrator, const PassRequest& request, int splits, Points& points) {
  const std::vector<uint64_t>& pass = request.tiles->pass;
  std::map<uint64_t, std::vector<size_t>> tilesOf;
  for (size_t t = 0; t < pass.size(); ++t)
    if (pass[t] != TilePass::kNone) tilesOf[pass[t]].push_back(t);
  std::vector<Group> groups;
  for (const auto& [one, tiles] : tilesOf) {
    const std::unique_ptr<PathPoints>& kept = points[one] =
        std::make_unique<PathPoints>(integrator, request.plan, one, splits);
    for (size_t first = 0; first < tiles.size(); first += kTogether) {
      const auto begin = tiles.begin() + static_cast<std::ptrdiff_t>(first);
      const size_t count = std::min(kTogether, tiles.size() - first);
      groups.push_back({kept.get(), {begin, begin + static_cast<std::ptrdiff_t>(count)}});
    }
  }
  return groups;
}

PixelWindow windowOf(const PixelWindow& window, size_t tile) {
  constexpr int kTile = SamplePlacement::kTile;
  const int columns = (window.width() + kTile - 1) / kTile, t = static_cast<int>(tile);
  const int x = window.x0 + t % columns * kTile, y = window.y0 + t / columns * kTile;
  return {x, y, std::min(x + kTile, window.x1), std::min(y + kTile, window.y1)};
}

}  // namespace

bool renderPlacedTiles(const Integrator& integrator, const PassRequest& request, PassTarget& target,
                       const PathAids& aids) {
  Points points;
  const std::vector<Group> groups = groupsOf(integrator, request, aids.splits, points);
  std::atomic<bool> cancelled{false};
  parallelFor(groups.size(), [&](size_t g) {
    if (request.cancel && request.cancel->load(std::memory_order_relaxed)) {
      cancelled = true;
      return;
    }
    PathKernel kernel(request.context, request.plan, groups[g].points->camera(), nullptr, integrator.roulette());
    kernel.use(groups[g].points->with(aids));
    uint64_t paths = 0, before = 0;
    for (const size_t t : groups[g].tiles) {
      const PixelWindow tile = windowOf(request.plan.window, t);
      renderTile(integrator, request, groups[g].points->camera(), tile, kernel, target);
      const uint64_t hits = kernel.rayCount - kernel.missCount;
      request.tiles->hits[t] += hits - before;
      before = hits;
      paths += pixelCount(tile);
    }
    if (!request.statistics) return;
    request.statistics->paths += paths;
    request.statistics->rays += kernel.rayCount;
    request.statistics->shadowRays += kernel.shadowRayCount;
  });
  return !cancelled;
}

}  // namespace braid
