// SPDX-License-Identifier: Apache-2.0
#include "integrators/sppm/sppm_throughput.h"

#include <ctime>
#include <memory>
#include <utility>

#include "integrators/light_preparation.h"
#include "integrators/sppm/sppm_eye.h"
#include "integrators/sppm/sppm_gather.h"
#include "integrators/sppm/sppm_preparation.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr uint64_t kEyeStream = 0x7370704502, kLightStream = 0x7370704503;

double threadSeconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Gathering {
  double seconds = 0;
  uint64_t queries = 0, photons = 0;
};

// All pixels' gather points are found a batch at a time, and only the gathering is timed.
Gathering gatherFrame(const TransportContext& context, const Plan& plan, const PhotonGrid& grid) {
  const PassSampler sampler(plan.settings.sampler, plan.settings.seed, kEyeStream, 0);
  const MediaStack media = mediaOfCamera(context.scene, plan.camera);
  PhotonEyeBatch batch(context, plan, sampler, media);
  std::vector<SubpathVertex> points;
  Gathering total;
  float checksum = 0;
  const PixelWindow& w = plan.window;
  const int pixels = w.width() * w.height();
  for (int first = 0; first < pixels; first += kBatch) {
    batch.clear();
    points.clear();
    for (int i = first; i < std::min(pixels, first + kBatch); ++i)
      batch.start(w.x0 + i % w.width(), w.y0 + i / w.width(), sampler.itemKey(static_cast<uint64_t>(i)));
    batch.run([&](int, const SubpathVertex& v) { points.push_back(v); });
    const double start = threadSeconds();
    for (const SubpathVertex& v : points) {
      const float radius = grid.scale().radiusAt(v.hit.position, v.travelled);
      const PhotonSum sum = gatherPhotons(grid, v, radius, plan.settings.maxDepth - v.segments);
      checksum += sum.outer.x;
      total.photons += sum.photons;
    }
    total.seconds += threadSeconds() - start;
    total.queries += points.size();
  }
  // Keeps the compiler from leaving the work out.
  if (checksum < 0) ++total.photons;
  return total;
}

}  // namespace

PhotonThroughput measurePhotonThroughput(const TransportContext& context, const Plan& plan) {
  PhotonThroughput result;
  withThreads(1, [&] {
    const PhotonPreparation preparation(context, plan);
    if (plan.settings.maxDepth < 2 || preparation.emission().empty()) return;
    const PassSampler sampler(plan.settings.sampler, plan.settings.seed, kLightStream, 0);
    const uint64_t paths = photonPaths(plan);
    TracedPhotons traced;
    const double start = threadSeconds();
    tracePhotons(context, {preparation.emission(), sampler, paths}, plan.settings, preparation.keep(), nullptr, traced);
    const double traceSeconds = threadSeconds() - start;
    const size_t stored = traced.photons.size();
    const double sortStart = threadSeconds();
    const PhotonGrid grid(std::move(traced.photons), gatherRadii(plan, context.scene.traits(), 0));
    result.sortSeconds = threadSeconds() - sortStart;
    const Gathering gathering = gatherFrame(context, plan, grid);
    result.segmentsPerSecond = static_cast<double>(traced.segments) / traceSeconds;
    result.storedPerPath = static_cast<double>(stored) / static_cast<double>(paths);
    if (gathering.queries == 0) return;
    result.queriesPerSecond = static_cast<double>(gathering.queries) / gathering.seconds;
    result.photonsPerQuery = static_cast<double>(gathering.photons) / static_cast<double>(gathering.queries);
  });
  return result;
}

}  // namespace braid
