// SPDX-License-Identifier: Apache-2.0
#include "tools/bench/bench_rays.h"

#include <algorithm>
#include <array>
#include <fstream>

#include "integrators/registry.h"
#include "integrators/sppm/sppm_throughput.h"
#include "renderer/core/hash.h"
#include "renderer/core/parallel.h"
#include "renderer/core/stopwatch.h"
#include "renderer/scene/embree_queries.h"

namespace braid {

namespace {

using Rays = std::vector<std::vector<RecordedRay>>;  // of every tile

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v[v.size() / 2];
}

// Peak resident memory of the process in bytes, from /proc.
uint64_t peakMemory() {
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line))
    if (line.rfind("VmHWM:", 0) == 0) return std::stoull(line.substr(6)) * 1024;
  return 0;
}

// Traces one recorded ray by Embree alone.
void traceRaw(RTCScene scene, const RecordedRay& r) {
  RTCRayHit query;
  query.ray.org_x = r.origin.x;
  query.ray.org_y = r.origin.y;
  query.ray.org_z = r.origin.z;
  query.ray.tnear = 0;
  query.ray.dir_x = r.direction.x;
  query.ray.dir_y = r.direction.y;
  query.ray.dir_z = r.direction.z;
  query.ray.time = 0;
  query.ray.tfar = r.tmax;
  query.ray.mask = ~0u;
  query.ray.id = 0;
  query.ray.flags = 0;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  if (r.shadow)
    embreeOccluded1(scene, query.ray, FilterContext(nullptr));
  else
    embreeIntersect1(scene, query, FilterContext(nullptr));
}

// Traces the recorded rays as the renderer does: in packets of neighbours of one kind.
void traceLikeRenderer(const Accel& accel, const std::vector<RecordedRay>& rays) {
  RayBatch batch;
  ShadowBatch shadows;
  std::array<RayHit, kBatch> hits;
  std::array<bool, kBatch> hidden;
  for (size_t i = 0; i < rays.size();) {
    const bool shadow = rays[i].shadow;
    int count = 0;
    for (; count < kBatch && i < rays.size() && rays[i].shadow == shadow; ++count, ++i)
      shadow ? shadows.set(count, rays[i]) : batch.set(count, rays[i]);
    if (shadow)
      accel.occluded(shadows, count, hidden.data());
    else
      accel.intersect(batch, count, hits.data());
  }
}

// A fixed random order: neighbours in memory have nothing in common.
void shuffle(std::vector<RecordedRay>& rays, uint64_t seed) {
  for (size_t i = rays.size(); i > 1; --i) std::swap(rays[i - 1], rays[mix64(seed + i) % i]);
}

// The halves of photon mapping by themselves, for one thread: medians over the repeats.
nlohmann::json benchPhotons(const TransportContext& context, const Plan& plan, int repeats) {
  std::vector<double> segments, queries, sorting;
  PhotonThroughput last;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    last = measurePhotonThroughput(context, plan);
    segments.push_back(last.segmentsPerSecond);
    queries.push_back(last.queriesPerSecond);
    sorting.push_back(last.sortSeconds);
  }
  return {{"segmentsPerSecond", median(segments)},
          {"queriesPerSecond", median(queries)},
          {"photonsPerQuery", last.photonsPerQuery},
          {"storedPerPath", last.storedPerPath},
          {"sortSeconds", median(sorting)}};
}

// What each repeat measured.
struct Rates {
  std::vector<double> paths, rays, raw, incoherent, ratio, incoherentRatio, embreeShare;
  uint64_t raysOfPass = 0;
};

class RayBench {
 public:
  RayBench(const TransportContext& context, const Plan& plan, const Accel& accel)
      : context_(context),
        plan_(plan),
        accel_(accel),
        integrator_(*plan.integrators.front().integrator),
        preparation_(integrator_.prepare(context, plan)),
        target_(plan.window.width(), plan.window.height(),
                {.splats = integrator_.splats(), .features = plan.kept.features}),
        film_(plan.window.width(), plan.window.height(), plan.buckets()) {
    integrator_.renderPass({context_, plan_, 0, nullptr, nullptr, &recorded_, preparation_.get()}, target_);
    shuffled_ = recorded_;
    for (size_t i = 0; i < shuffled_.size(); ++i) shuffle(shuffled_[i], i);
    for (const auto& tile : recorded_) recordedRays_ += tile.size();
  }

  // Times the passes and the bare calls, one after the other, so that a change of clock or load hits both alike.
  void repeat(uint64_t passes, Rates& rates) {
    PassStatistics statistics;
    const double renderSeconds = timePasses(passes, statistics);
    const double rawSeconds = timeRaw(recorded_), incoherentSeconds = timeRaw(shuffled_);
    const Stopwatch inEmbree;
    parallelFor(recorded_.size(), [&](size_t i) { traceLikeRenderer(accel_, recorded_[i]); });
    rates.embreeShare.push_back(inEmbree.seconds() * static_cast<double>(passes) / renderSeconds);
    const uint64_t rays = statistics.rays + statistics.shadowRays;
    rates.raysOfPass = rays / passes;
    rates.paths.push_back(static_cast<double>(statistics.paths) / renderSeconds);
    rates.rays.push_back(static_cast<double>(rays) / renderSeconds);
    rates.raw.push_back(static_cast<double>(recordedRays_) / rawSeconds);
    rates.incoherent.push_back(static_cast<double>(recordedRays_) / incoherentSeconds);
    rates.ratio.push_back(rates.rays.back() / rates.raw.back());
    rates.incoherentRatio.push_back(rates.rays.back() / rates.incoherent.back());
  }

 private:
  double timePasses(uint64_t passes, PassStatistics& statistics) {
    const Stopwatch clock;
    for (uint64_t k = 0; k < passes; ++k) {
      target_.clear();
      integrator_.renderPass({context_, plan_, film_.passes(), nullptr, &statistics, nullptr, preparation_.get()},
                             target_);
      film_.commit(film_.passes(), target_);
    }
    return clock.seconds();
  }

  double timeRaw(const Rays& tiles) const {
    const Stopwatch clock;
    parallelFor(tiles.size(), [&](size_t i) {
      for (const RecordedRay& r : tiles[i]) traceRaw(accel_.handle(), r);
    });
    return clock.seconds();
  }

  const TransportContext& context_;
  const Plan& plan_;
  const Accel& accel_;
  const Integrator& integrator_;
  const std::shared_ptr<const Preparation> preparation_;  // once, as for a render: passes without one make their own
  PassTarget target_;
  Accumulator film_;
  Rays recorded_, shuffled_;
  uint64_t recordedRays_ = 0;
};

nlohmann::json toJson(const Scene& scene, const Plan& plan, const Rates& rates) {
  const auto pixels = static_cast<double>(plan.window.width()) * plan.window.height();
  const auto hierarchyBytes = static_cast<double>(scene.accel().bytes());
  const auto sceneBytes = static_cast<double>(scene.accel().bytes() + scene.geometryBytes());
  const double triangles = std::max<double>(1, static_cast<double>(scene.traits().triangles));
  return {{"triangles", scene.traits().triangles},
          {"pathsPerSecond", median(rates.paths)},
          {"raysPerSecond", median(rates.rays)},
          {"rawRaysPerSecond", median(rates.raw)},
          {"ratio", median(rates.ratio)},
          {"rawIncoherentRaysPerSecond", median(rates.incoherent)},
          {"incoherentRatio", median(rates.incoherentRatio)},
          {"embreeShare", median(rates.embreeShare)},
          {"raysPerPath", static_cast<double>(rates.raysOfPass) / pixels},
          {"hierarchySeconds", scene.buildTimes().hierarchy},
          {"hierarchyBytesPerTriangle", hierarchyBytes / triangles},
          {"sceneBytesPerTriangle", sceneBytes / triangles},
          {"filmBytesPerPixel", plan.filmBytesPerPixel}};
}

}  // namespace

nlohmann::json benchRays(const Scene& scene, const CameraData& camera, const Settings& settings, int repeats) {
  const auto integrators = makeIntegrators();
  const Plan plan = makePlan(scene, camera, settings, pointersTo(integrators));
  const TransportContext context(scene, settings.lightStrategy);
  Rates rates;
  withThreads(settings.threads, [&] {
    RayBench bench(context, plan, scene.accel());
    const uint64_t passes = std::max<uint64_t>(1, settings.spp / static_cast<uint64_t>(repeats));
    for (int k = 0; k < repeats; ++k) bench.repeat(passes, rates);
  });
  nlohmann::json record = toJson(scene, plan, rates);
  record["lightBytes"] = context.lights.bytes();
  record["photons"] = benchPhotons(context, plan, repeats);
  record["peakMemoryBytes"] = peakMemory();
  return record;
}

}  // namespace braid
