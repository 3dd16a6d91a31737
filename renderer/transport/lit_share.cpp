// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/lit_share.h"

#include <array>
#include <cmath>

#include "renderer/transport/glance.h"
#include "renderer/transport/shadow_ray.h"
#include "renderer/transport/subpath.h"

namespace braid {

namespace {

constexpr int kCameraPaths = 4096;
constexpr uint64_t kLitSeed = 0x6c6974;
constexpr int kLitSegments = 12;
// From so much weight on, a share this large is no accident of where the first paths went.
constexpr double kEnoughSeen = 128, kEnoughLit = 0.1;

float emittedTowards(const Scene& scene, const Hit& hit) {
  return hit.material->emissive() ? average(emissionAt(scene, hit)) : 0;
}

// What the paths of one batch see.
class LitGlance {
 public:
  LitGlance(const TransportContext& context, const PassSampler& sampler)
      : context_(context), sampler_(sampler), rays_(context) {}

  Onward onHit(int index, const SubpathVertex& vertex) {
    const auto i = static_cast<size_t>(index);
    met_ = true;
    if (vertex.hit.material->unlit) {
      unlit_ += static_cast<double>(average(vertex.throughput));
      return Onward::End;
    }
    emitted_[i] += emittedTowards(context_.scene, vertex.hit);
    if (!vertex.bsdf.hasNonDelta()) return Onward::Scatter;
    weight_[i] = average(vertex.throughput);
    sampleLight(i, vertex);
    return Onward::End;
  }
  // A mirror or a pane that shows the void is seen, and dark.
  void onMiss(int index, const SubpathState& state) {
    if (!state.fromCamera()) weight_[static_cast<size_t>(index)] = average(state.throughput);
  }

  void addTo(LitShare& sum, double reference) {
    rays_.trace(shadows_);
    for (int k = 0; k < shadows_; ++k) {
      if (rays_.hidden(k)) continue;
      Spectrum arriving(arriving_[static_cast<size_t>(k)]);
      rays_.attenuate(k, arriving);
      received_[owner_[static_cast<size_t>(k)]] += average(arriving);
    }
    for (size_t i = 0; i < weight_.size(); ++i) {
      const double weight = static_cast<double>(weight_[i]);
      if (!(weight > 0) || !std::isfinite(weight)) continue;
      sum.seen += weight;
      sum.share += weight * std::min(1.0, static_cast<double>(emitted_[i] + received_[i]) / reference);
      sum.received += weight * std::min(1.0, static_cast<double>(received_[i]) / reference);
    }
    if (std::isfinite(unlit_)) sum.unlit += unlit_;
    sum.seesSurfaces = sum.seesSurfaces || met_;
  }

 private:
  void sampleLight(size_t i, const SubpathVertex& vertex) {
    const SampleBlock u = sampler_.block(vertex.key, vertex.block);
    const Hit& hit = vertex.hit;
    LightSample light;
    if (!context_.lights.sample(vertex.receiver(), u.u[slot::kLightSelect], {u.u[slot::kLightU], u.u[slot::kLightV]},
                                light))
      return;
    // As in the path tracer: from the side that is seen by both normals, unless the surface transmits.
    const float shading = glm::dot(light.wi, hit.frame.n);
    const bool reflects = glm::dot(light.wi, hit.ng) > 0;
    if (reflects != (shading > 0) || (!reflects && !vertex.twoSided)) return;
    const float cosine = std::abs(shading);
    const float value = average(light.radiance) * cosine * kInvPi / light.pdfW;
    if (!(value > 0) || !std::isfinite(value)) return;
    const auto k = static_cast<size_t>(shadows_);
    owner_[k] = i;
    arriving_[k] = value;
    const uint32_t salt = sampler_.salt(vertex.key, 0) & ~kCameraRay;
    rays_.set(shadows_++, shadowRay(hit, light.wi, light.distance, salt), mediumIndex(context_.scene, vertex.media));
  }

  const TransportContext& context_;
  const PassSampler& sampler_;
  std::array<float, kBatch> weight_{}, emitted_{}, received_{}, arriving_{};
  std::array<size_t, kBatch> owner_{};
  VisibilityBatch rays_;
  int shadows_ = 0;
  double unlit_ = 0;
  bool met_ = false;
};

}  // namespace

LitShare measureLitShare(const TransportContext& context, const Camera& camera, int width, int height,
                         double reference) {
  const PassSampler sampler(SamplerKind::Independent, kLitSeed, 0, 0, 1);
  const MediaStack media = mediaOfCamera(context.scene, camera);
  const Vec2 frame(static_cast<float>(width), static_cast<float>(height));
  SubpathBatch batch(context, sampler, glanceSettings(kLitSegments));
  LitShare lit;
  for (int first = 0; first < kCameraPaths; first += kBatch) {
    batch.clear();
    for (int i = first; i < first + kBatch; ++i) startGlance(context.scene, camera, frame, media, i, batch);
    LitGlance glance(context, sampler);
    batch.run([&](int index, const SubpathState&, const SubpathVertex& v) { return glance.onHit(index, v); },
              [&](int index, const SubpathState& state) { glance.onMiss(index, state); });
    glance.addTo(lit, reference);
    if (lit.seen > kEnoughSeen && lit.received > kEnoughLit * lit.seen) break;
  }
  if (lit.seen > 0) {
    lit.share /= lit.seen;
    lit.received /= lit.seen;
  }
  return lit;
}

}  // namespace braid
