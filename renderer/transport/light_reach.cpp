// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/light_reach.h"

#include <algorithm>
#include <bit>
#include <map>
#include <unordered_map>

#include "renderer/transport/light_emission.h"
#include "renderer/transport/subpath.h"

namespace braid {

namespace {

constexpr uint64_t kPaths = 16384;
constexpr int kEyePaths = 16384;
constexpr uint64_t kSeed = 0x7265616368;
constexpr int kMaxSegments = 12;
// A direction density above this is focusing: more than a tenth of the light within 0.02 sr or so.
constexpr float kFocusingPdf = 10;
// No camera path is expected to find a light by chance more rarely than this; keeps point lights finite.
constexpr double kLeastProbability = 1e-6;

// Areas of the lamps: of all emissive triangles of a mesh together, because any of them will do for a path.
std::map<uint32_t, double> lampAreas(const Scene& scene) {
  std::map<uint32_t, double> areas;
  for (const EmissiveTriangle& e : scene.emitters()) areas[e.mesh] += static_cast<double>(e.area);
  return areas;
}

// The probability that a camera path from a surface finds a caustic there: the share of the hemisphere that the lamp
// fills, seen over `length` metres of path, or that of the directions to which the rough surface on the way sends what
// it focuses, with this density per steradian (infinite: smooth). There a light sample finds the lamp.
double chanceToFind(double area, float length, float pdfW) {
  const double lamp = area / (static_cast<double>(kPi) * sqr(static_cast<double>(length)));
  const double lobe = 1 / (static_cast<double>(kPi) * static_cast<double>(pdfW));
  return std::clamp(std::max(lamp, lobe), kLeastProbability, 1.0);
}

// Where in space the camera sees rough surfaces, also over mirrors and through glass: cells that grow with the distance
// from the camera, each with the weight that its surfaces have in the image.
class VisibleCells {
 public:
  explicit VisibleCells(const Vec3& camera, float smallest) : camera_(camera), smallest_(smallest) {}
  void add(const Vec3& p, const Vec3& normal, double weight, bool overMirrors) {
    const uint64_t key = keyOf(p, sizeOf(p));
    cells_[key] += weight;
    sides_[sideOf(key, normal)] += weight;
    if (overMirrors) overMirrors_[key] += weight;
    total_ += weight;
  }
  double total() const { return total_; }
  // Weight per m² of surface at a point.
  double density(const Vec3& p) const { return densityIn(cells_, p, keyOf(p, sizeOf(p))); }
  // The same of what is seen over mirrors and through glass.
  double densityOverMirrors(const Vec3& p) const { return densityIn(overMirrors_, p, keyOf(p, sizeOf(p))); }
  // That of surfaces that face roughly the same way: cells are larger than walls are thick.
  double density(const Vec3& p, const Vec3& normal) const {
    return densityIn(sides_, p, sideOf(keyOf(p, sizeOf(p)), normal));
  }

 private:
  // About three degrees wide.
  float sizeOf(const Vec3& p) const {
    return std::exp2(std::floor(std::log2(std::max(0.05f * glm::length(p - camera_), smallest_))));
  }
  uint64_t keyOf(const Vec3& p, float size) const {
    const Vec3 cell = glm::floor((p - camera_) / size);
    uint64_t key = std::bit_cast<uint32_t>(size);
    for (int c = 0; c < 3; ++c) key = hashCombine(key, std::bit_cast<uint32_t>(cell[c] + 0.0f));
    return key;
  }
  static uint64_t sideOf(uint64_t key, const Vec3& normal) {
    return hashCombine(key, (normal.x > 0 ? 1u : 0u) + (normal.y > 0 ? 2u : 0u) + (normal.z > 0 ? 4u : 0u));
  }
  double densityIn(const std::unordered_map<uint64_t, double>& cells, const Vec3& p, uint64_t key) const {
    const auto found = cells.find(key);
    return found == cells.end() ? 0 : found->second / sqr(static_cast<double>(sizeOf(p)));
  }
  Vec3 camera_;
  float smallest_;
  double total_ = 0;
  std::unordered_map<uint64_t, double> cells_, sides_, overMirrors_;
};

WalkSettings probeWalk(Transport transport) {
  WalkSettings settings;
  settings.transport = transport;
  settings.maxSegments = kMaxSegments;
  settings.roulette = {transport == Transport::Power ? 1 : Roulette::kNever, 1};
  settings.mis = false;
  return settings;
}

VisibleCells findVisibleCells(const TransportContext& context, const PassSampler& sampler, const Camera& camera,
                              int width, int height) {
  VisibleCells cells(camera.position(), 1e-6f * context.scene.traits().radius);
  SubpathBatch batch(context, sampler, probeWalk(Transport::Radiance));
  const auto onHit = [&](int, const SubpathState& state, const SubpathVertex& vertex) {
    if (!(state.leastPdfW > kFocusingPdf)) return Onward::End;
    if (vertex.bsdf.hasNonDelta())
      cells.add(vertex.hit.position, vertex.hit.ng, static_cast<double>(average(vertex.throughput)),
                vertex.deltaOnly && vertex.segments > 1);
    return Onward::Scatter;
  };
  for (int first = 0; first < kEyePaths; first += kBatch) {
    batch.clear();
    for (int i = first; i < first + kBatch; ++i) {
      const uint64_t key = sampler.itemKey(kPaths + static_cast<uint64_t>(i));
      const SampleBlock u = sampler.block(key, 0);
      // Rows of the frame are stratified.
      const Vec2 raster(u.u[slot::kPixelX] * static_cast<float>(width),
                        (static_cast<float>(i) + u.u[slot::kPixelY]) / kEyePaths * static_cast<float>(height));
      const float time = context.scene.timeAt(u.u[slot::kTime]);
      Camera::CameraRay ray = CameraAt(camera, time)->ray(raster);
      ray.time = time;
      batch.startCamera(key, ray, MediaStack(), 1, 1, camera.orthographic());
    }
    batch.run(onHit, [](int, const SubpathState&) {});
  }
  return cells;
}

// Adds up what light subpaths bring to the cells that the camera sees.
class ReachSums {
 public:
  ReachSums(const TransportContext& context, const VisibleCells& visible)
      : context_(context), visible_(visible), areas_(lampAreas(context.scene)) {}

  Onward onHit(int index, const SubpathState& state, const SubpathVertex& vertex) {
    bool& aimless = deltaFirst_[static_cast<size_t>(index)];
    if (vertex.segments == 1) aimless = vertex.walked;
    if (vertex.segments == 2) aimless = aimless || vertex.deltaOnly;
    if (vertex.woBelow || !vertex.bsdf.hasNonDelta()) return Onward::Scatter;
    const double density = visible_.density(vertex.hit.position);
    const double light = static_cast<double>(average(vertex.throughput * vertex.bsdf.albedo())),
                 value = density * light;
    if (!(value > 0) || !std::isfinite(value)) return Onward::Scatter;
    total_ += value;
    const bool lamp = state.light < context_.lights.firstPositional();
    if (aimless && !lamp) {
      reach_.beyondCameraPaths += value;
      if (state.leastPdfW == 0) reach_.throughMedia += value;  // media alone make it that
      if (vertex.deltaOnly) reach_.beyondConnections += visible_.densityOverMirrors(vertex.hit.position) * light;
    }
    addShares(state, vertex, light, value, aimless);
    return Onward::Scatter;
  }

  LightReach result() const {
    LightReach r = reach_;
    if (total_ > 0)
      for (double* share : {&r.direct, &r.indirect, &r.caustic, &r.causticBySmooth, &r.causticOverMirrors,
                            &r.causticVariance, &r.beyondCameraPaths, &r.beyondConnections, &r.throughMedia})
        *share /= total_;
    if (scattered_ > 0 && std::isfinite(scattered_))
      r.scatteredRadiance = scattered_ / (static_cast<double>(kPi) * kPaths * visible_.total());
    return r;
  }

 private:
  // `aimless`: light samples cannot be aimed over the first surface.
  void addShares(const SubpathState& state, const SubpathVertex& vertex, double light, double value, bool aimless) {
    if (vertex.segments == 1 && !vertex.walked) {
      reach_.direct += value;
      return;
    }
    scattered_ +=
        visible_.density(vertex.hit.position, vertex.hit.ng) * static_cast<double>(average(vertex.throughput));
    if (!(state.leastPdfW > kFocusingPdf)) {
      reach_.indirect += value;
      return;
    }
    reach_.caustic += value;
    reach_.causticOverMirrors += visible_.densityOverMirrors(vertex.hit.position) * light;
    const bool lamp = state.light < context_.lights.firstPositional();
    const float pdfW = aimless ? kInfinity : state.leastPdfW;
    if (pdfW == kInfinity) reach_.causticBySmooth += value;
    const double area = lamp ? areas_.at(context_.scene.emitters()[state.light].mesh) : 0;
    reach_.causticVariance += value / chanceToFind(area, state.travelled, pdfW);
  }

  const TransportContext& context_;
  const VisibleCells& visible_;
  std::map<uint32_t, double> areas_;
  LightReach reach_;
  double total_ = 0, scattered_ = 0;
  std::array<bool, kBatch> deltaFirst_{};  // of each walk: its first scattering was delta, or by a medium
};

// Starts the light subpath of an item.
void startLightPath(const TransportContext& context, const LightEmission& emission, const PassSampler& sampler,
                    uint64_t item, SubpathBatch& batch) {
  const uint64_t key = sampler.itemKey(item);
  const SampleBlock u = sampler.block(key, 1);
  const double select = (static_cast<double>(item) + static_cast<double>(u.u[slot::kLightSelect])) / kPaths;
  LightStart start;
  const float time = context.scene.timeAt(u.u[slot::kExtra]);
  const bool ok = emission.sample(select, {u.u[slot::kLightU], u.u[slot::kLightV]},
                                  {u.u[slot::kBsdfU], u.u[slot::kBsdfV]}, time, start);
  // The environment fills so much of what surfaces see that camera paths find it.
  if (ok && start.light != context.lights.environmentLight())
    batch.startLight(key, start, emission.mediaAt(start));
  else
    batch.startNothing();
}

}  // namespace

LightReach measureLightReach(const TransportContext& context, const Camera& camera, int width, int height) {
  const LightEmission emission(context.scene, context.lights);
  if (emission.empty()) return {};
  const PassSampler sampler(SamplerKind::Independent, kSeed, 0, 0, 1);
  const VisibleCells visible = findVisibleCells(context, sampler, camera, width, height);
  ReachSums sums(context, visible);
  SubpathBatch batch(context, sampler, probeWalk(Transport::Power));
  for (uint64_t first = 0; first < kPaths; first += kBatch) {
    batch.clear();
    for (uint64_t item = first; item < first + kBatch; ++item) startLightPath(context, emission, sampler, item, batch);
    batch.run([&](int i, const SubpathState& state, const SubpathVertex& v) { return sums.onHit(i, state, v); },
              [](int, const SubpathState&) {});
  }
  return sums.result();
}

}  // namespace braid
