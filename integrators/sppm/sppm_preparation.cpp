// SPDX-License-Identifier: Apache-2.0
#include "integrators/sppm/sppm_preparation.h"

#include <atomic>
#include <cmath>
#include <utility>

#include "integrators/light_preparation.h"
#include "integrators/sppm/sppm_eye.h"
#include "integrators/sppm/sppm_gather.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr uint64_t kEyeStream = 0x7370704500, kLightStream = 0x7370704501;
constexpr uint64_t kMostPaths = 65536, kFewestPaths = 1024;
constexpr int kEyeColumns = 64;  // at most so many pilot pixels a side
// No light gets less than this share of what its power alone would give it: the pilot may be wrong.
constexpr float kFloor = 0.1f;
// Lights with fewer pilot paths than this are judged together with their neighbours in the numbering.
constexpr uint64_t kPathsPerGroup = 64;
// Aiming must promise at least this reduction of the variance.
constexpr double kPays = 0.9;

// Light subpaths of each light, and how many of them left a photon where the camera looks.
struct LightRecord {
  uint32_t paths = 0, useful = 0;
};

// Rows of pixels and groups of light paths each have a time of their own: multiples of the golden ratio.
float pilotTime(const Scene& scene, size_t i) {
  const double share = 0.6180339887498949 * static_cast<double>(i);
  return scene.timeAt(static_cast<float>(share - std::floor(share)));
}

// Points that the camera sees, directly or through narrow lobes, on a grid of pixels; as photons, to be searched.
std::vector<Photon> visiblePoints(const TransportContext& context, const Plan& plan, int stride) {
  const PixelWindow& w = plan.window;
  const int columns = (w.width() + stride - 1) / stride, rows = (w.height() + stride - 1) / stride;
  const PassSampler sampler(SamplerKind::Independent, plan.settings.seed, kEyeStream, 0);
  std::vector<std::vector<Photon>> rowPoints(static_cast<size_t>(rows));
  parallelRows(rows, [&](int row) {
    const float time = pilotTime(context.scene, static_cast<size_t>(row));
    const MediaStack media = mediaOfCamera(context.scene, plan.camera, time);
    PhotonEyeBatch batch(context, plan, sampler, media, nullptr, time);
    for (int first = 0; first < columns; first += kBatch) {
      batch.clear();
      for (int column = first; column < std::min(columns, first + kBatch); ++column)
        batch.start(w.x0 + column * stride, w.y0 + row * stride,
                    sampler.itemKey(static_cast<uint64_t>(row * columns + column)));
      batch.run([&](int, const SubpathVertex& vertex) {
        Photon point;
        point.position = vertex.hit.position;
        rowPoints[static_cast<size_t>(row)].push_back(point);
      });
    }
  });
  std::vector<Photon> points;
  for (const std::vector<Photon>& r : rowPoints) points.insert(points.end(), r.begin(), r.end());
  return points;
}

// Chances that a light's path leaves a useful photon, lights without enough paths pooled; never 0.
std::vector<double> chances(const std::vector<LightRecord>& records, const LightSampler& lights) {
  double paths = 0, useful = 0;
  for (const LightRecord& r : records) {
    paths += r.paths;
    useful += r.useful;
  }
  const double overall = (useful + 1) / (paths + 2);
  std::vector<double> chance(records.size());
  size_t begin = 0;
  uint64_t groupPaths = 0, groupUseful = 0;
  for (size_t i = 0; i < records.size(); ++i) {
    groupPaths += records[i].paths;
    groupUseful += records[i].useful;
    const size_t next = i + 1;
    const bool kindEnds = next == lights.firstPositional() || next >= lights.firstDirectional();
    if (groupPaths < kPathsPerGroup && !kindEnds && next < records.size()) continue;
    // A few paths of the average light stand in for what the group's own paths cannot tell.
    const double c = (static_cast<double>(groupUseful) + 4 * overall) / (static_cast<double>(groupPaths) + 4);
    std::fill(chance.begin() + static_cast<std::ptrdiff_t>(begin), chance.begin() + static_cast<std::ptrdiff_t>(next),
              c);
    begin = next;
    groupPaths = groupUseful = 0;
  }
  return chance;
}

// A path of light l carries P_l / p_l and matters with chance c_l, so the variance goes as Σ P_l² c_l / p_l: least for
// p_l ∝ P_l √c_l. Empty where power alone is about as good.
std::vector<float> usefulness(const LightEmission& emission, const std::vector<double>& chance) {
  double most = 0;
  for (const double c : chance) most = std::max(most, c);
  std::vector<float> factor(chance.size());
  double byPower = 0, aimed = 0, norm = 0;
  for (uint32_t i = 0; i < chance.size(); ++i) {
    factor[i] = std::max(static_cast<float>(std::sqrt(chance[i] / most)), kFloor);
    const double power = emission.probability(i);
    byPower += power * chance[i];
    aimed += power * chance[i] / static_cast<double>(factor[i]);
    norm += power * static_cast<double>(factor[i]);
  }
  return aimed * norm < kPays * byPower ? factor : std::vector<float>();
}

struct Pilot {
  std::vector<LightRecord> lights;
  double storedPerPath = 0;
};

Pilot runPilot(const TransportContext& context, const Plan& plan, const LightEmission& emission) {
  const uint64_t pixels = static_cast<uint64_t>(plan.window.width()) * static_cast<uint64_t>(plan.window.height());
  const uint64_t paths = std::clamp(pixels / 4, kFewestPaths, kMostPaths);
  const int longest = std::max(plan.window.width(), plan.window.height());
  const int stride = (longest + kEyeColumns - 1) / kEyeColumns;
  // A photon counts where it lies within the pixels that a pilot pixel stands for.
  Plan coarse = plan;
  coarse.settings.photonRadius = std::max(plan.settings.photonRadius, static_cast<float>(stride));
  const bool aiming = plan.settings.photonAiming;
  const PhotonGrid visible(aiming ? visiblePoints(context, plan, stride) : std::vector<Photon>(),
                           gatherRadii(coarse, context.scene.traits(), 0));

  const PassSampler sampler(SamplerKind::Independent, plan.settings.seed, kLightStream, 0);
  const PhotonEmission light{emission, sampler, paths};
  const int firstSegment = firstPhotonSegment(plan.settings);
  const bool merges = mergesCaustics(context.scene, plan.settings.maxDepth);
  constexpr uint64_t kNever = ~uint64_t(0);
  std::atomic<uint64_t> stored{0};
  std::vector<LightRecord> records(context.lights.size());
  constexpr uint64_t kChunk = 4 * kBatch;
  parallelChunks(static_cast<size_t>(paths), kChunk, [&](size_t begin, size_t end) {
    std::array<uint64_t, kBatch> counted;  // by walk of the batch: the last path that was counted as useful
    counted.fill(kNever);
    uint64_t storedHere = 0;
    PhotonEmission chunk = light;
    chunk.time = pilotTime(context.scene, begin / kChunk);
    followLightPaths(context, chunk, plan.settings.maxDepth, begin, end,
                     [&](uint64_t item, const SubpathState& state, const SubpathVertex& v) {
                       LightRecord& record = records[state.light];
                       if (v.segments == 1 && !state.throughPane) std::atomic_ref<uint32_t>(record.paths).fetch_add(1);
                       if (merges && depositsCaustic(v)) ++storedHere;
                       if (!depositsPhoton(v, firstSegment)) return Onward::Scatter;
                       ++storedHere;
                       uint64_t& last = counted[(item - begin) % kBatch];
                       if (!aiming || last == item) return Onward::Scatter;
                       const Vec3& p = v.hit.position;
                       const RadiusScale& scale = visible.scale();
                       const float radius = scale.radiusAt(p, 2 * glm::length(p - scale.camera));
                       bool seen = false;
                       visible.query(p, radius, [&](const Photon&, float) { seen = true; });
                       if (!seen) return Onward::Scatter;
                       last = item;
                       std::atomic_ref<uint32_t>(record.useful).fetch_add(1);
                       return Onward::Scatter;
                     });
    stored += storedHere;
  });
  return {std::move(records), static_cast<double>(stored) / static_cast<double>(paths)};
}

}  // namespace

PhotonPreparation::PhotonPreparation(const TransportContext& context, const Plan& plan)
    : emission_(std::in_place, context.scene, context.lights) {
  if (emission_->empty() || plan.settings.maxDepth < 2) return;
  const Pilot pilot = runPilot(context, plan, *emission_);
  // A tenth to spare for what the pilot did not see.
  keep_ = static_cast<float>(std::min(1.0, kStoredPerPath / (1.1 * std::max(pilot.storedPerPath, 1e-3))));
  if (!plan.settings.photonAiming || context.lights.size() < 2) return;
  const std::vector<float> factors = usefulness(*emission_, chances(pilot.lights, context.lights));
  if (factors.empty()) return;
  emission_.emplace(context.scene, context.lights, factors);
  aimed_ = true;
}

}  // namespace braid
