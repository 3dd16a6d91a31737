// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/light_kinds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "renderer/transport/glance.h"
#include "renderer/transport/shadow_ray.h"

namespace braid {

namespace {

constexpr int kCameraPaths = 4096, kSegments = 4;
constexpr uint64_t kKindsSeed = 0x6b696e6473;
constexpr int kCellsAcross = 16;  // parts of the frame that have a brightness of their own
constexpr double kEven = 0.2;
constexpr double kDark = 0.1;  // of the frame's brightness count in every part, as relL2 does
constexpr double kMost = 16;   // times the brightness: single finds of more would decide alone
constexpr int kSteps = 32;
constexpr double kLeast = 1e-6;  // of a share, so that it can grow again

// What one light sample brings to its pixel, where it is the only kind and has no weight.
struct Find {
  size_t cell = 0, kind = 0;
  double value = 0;
  double density = 0, bsdfDensity = 0;  // per steradian; of a light without size 1 and 0
};

// The finds of a batch of camera paths.
class KindsGlance {
 public:
  KindsGlance(const TransportContext& context, const PassSampler& sampler, int first)
      : context_(context), sampler_(sampler), first_(first), rays_(context) {}

  Onward onHit(int index, const SubpathVertex& vertex) {
    if (vertex.hit.material->unlit) return Onward::End;
    if (!vertex.bsdf.hasNonDelta()) return Onward::Scatter;
    const LightKinds& kinds = context_.lights.kinds();
    float begin = 0;
    for (size_t kind = 0; kind < kinds.size(); begin += kinds[kind++])
      if (kinds[kind] > 0) sampleKind(index, vertex, kind, begin, kinds[kind]);
    return vertex.segments < kSegments ? Onward::Scatter : Onward::End;
  }

  std::vector<Find> take() {
    trace();
    return std::move(finds_);
  }

 private:
  void sampleKind(int index, const SubpathVertex& vertex, size_t kind, float begin, float share) {
    const SampleBlock u = sampler_.block(vertex.key, vertex.block);
    // The same variate for all kinds, in the part of [0, 1) that chooses this one.
    const float select = begin + share * std::clamp(u.u[slot::kLightSelect], 0.001f, 0.999f);
    LightSample light;
    if (!context_.lights.sample(vertex.receiver(), select, {u.u[slot::kLightU], u.u[slot::kLightV]}, light)) return;
    const VertexValue toLight = evaluateVertex(context_, vertex, Transport::Radiance, light.wi);
    const float density = light.pdfW / share;
    const double value = static_cast<double>(average(vertex.throughput * toLight.f * light.radiance) / density);
    if (!(value > 0) || !std::isfinite(value)) return;
    if (waiting_.size() == kBatch) trace();
    const uint32_t salt = sampler_.salt(vertex.key, 0) & ~kCameraRay;
    rays_.set(static_cast<int>(waiting_.size()), shadowRay(vertex.hit, light.wi, light.distance, salt),
              mediumIndex(context_.scene, vertex.media));
    const float bsdfDensity = light.delta ? 0 : toLight.pdfW;
    waiting_.push_back({cellOf(framePoint(first_ + index)), kind, value, static_cast<double>(density),
                        static_cast<double>(bsdfDensity)});
  }

  static size_t cellOf(Vec2 at) {
    const auto part = [](float v) { return std::min(static_cast<size_t>(v * kCellsAcross), size_t(kCellsAcross - 1)); };
    return part(at.y) * kCellsAcross + part(at.x);
  }

  void trace() {
    rays_.trace(static_cast<int>(waiting_.size()));
    for (size_t k = 0; k < waiting_.size(); ++k) {
      if (rays_.hidden(static_cast<int>(k))) continue;
      Spectrum passing(1);
      rays_.attenuate(static_cast<int>(k), passing);
      waiting_[k].value *= static_cast<double>(average(passing));
      finds_.push_back(waiting_[k]);
    }
    waiting_.clear();
  }

  const TransportContext& context_;
  const PassSampler& sampler_;
  int first_;
  VisibilityBatch rays_;
  std::vector<Find> waiting_, finds_;
};

std::vector<Find> findLight(const TransportContext& context, const Camera& camera, Vec2 frame) {
  const PassSampler sampler(SamplerKind::Independent, kKindsSeed, 0, 0, 1);
  const MediaStack media = mediaOfCamera(context.scene, camera);
  SubpathBatch batch(context, sampler, glanceSettings(kSegments));
  std::vector<Find> all;
  for (int first = 0; first < kCameraPaths; first += kBatch) {
    batch.clear();
    for (int i = first; i < first + kBatch; ++i) startGlance(context.scene, camera, frame, media, i, batch);
    KindsGlance glance(context, sampler, first);
    batch.run([&](int index, const SubpathState&, const SubpathVertex& v) { return glance.onHit(index, v); },
              [](int, const SubpathState&) {});
    const std::vector<Find> finds = glance.take();
    all.insert(all.end(), finds.begin(), finds.end());
  }
  return all;
}

// Values relative to the brightness of their parts of the frame.
void makeRelative(std::vector<Find>& finds) {
  constexpr size_t kCells = kCellsAcross * kCellsAcross;
  std::array<double, kCells> brightness{};
  double mean = 0;
  for (const Find& f : finds) {
    brightness[f.cell] += f.value * (static_cast<double>(kCells) / kCameraPaths);
    mean += f.value / kCameraPaths;
  }
  for (Find& f : finds) f.value = std::min(f.value / (brightness[f.cell] + kDark * mean), kMost);
}

// The shares that minimise ∫ value² / (share · density + bsdfDensity), summed over kinds: the derivatives by all shares
// are equal there. The sum is convex, and every step takes each share nearer to that.
std::array<double, 3> bestShares(const std::vector<Find>& finds, const LightKinds& kinds) {
  std::array<double, 3> shares{};
  for (size_t kind = 0; kind < shares.size(); ++kind) shares[kind] = static_cast<double>(kinds[kind]);
  for (int step = 0; step < kSteps; ++step) {
    std::array<double, 3> slopes{};
    for (const Find& f : finds)
      slopes[f.kind] += sqr(f.value * f.density / (shares[f.kind] * f.density + f.bsdfDensity));
    double sum = 0;
    for (size_t kind = 0; kind < shares.size(); ++kind) sum += shares[kind] *= std::sqrt(slopes[kind]);
    if (!(sum > 0) || !std::isfinite(sum)) return {};
    for (double& share : shares) share = std::max(share / sum, kLeast);
  }
  return shares;
}

}  // namespace

int lightKinds(const Scene& scene) {
  const std::vector<PunctualLight>& lights = scene.lights();
  const auto directional = static_cast<size_t>(std::count_if(
      lights.begin(), lights.end(), [](const PunctualLight& l) { return l.kind == PunctualKind::Directional; }));
  const bool finite = !scene.emitters().empty() || directional < lights.size();
  return (finite ? 1 : 0) + (directional > 0 ? 1 : 0) + (scene.environment() ? 1 : 0);
}

LightKinds measureLightKinds(const TransportContext& context, const Camera& camera, int width, int height) {
  LightKinds kinds = context.lights.kinds();
  const auto present = std::count_if(kinds.begin(), kinds.end(), [](float share) { return share > 0; });
  if (present < 2) return kinds;
  const Vec2 frame(static_cast<float>(width), static_cast<float>(height));
  std::vector<Find> finds = findLight(context, camera, frame);
  makeRelative(finds);
  const std::array<double, 3> best = bestShares(finds, kinds);
  const double sum = best[0] + best[1] + best[2];
  if (!(sum > 0)) return kinds;
  for (size_t kind = 0; kind < kinds.size(); ++kind)
    if (kinds[kind] > 0)
      kinds[kind] = static_cast<float>(kEven / static_cast<double>(present) + (1 - kEven) * best[kind] / sum);
  return kinds;
}

}  // namespace braid
