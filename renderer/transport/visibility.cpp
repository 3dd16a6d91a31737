// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/visibility.h"

#include "renderer/transport/bsdf/bsdf.h"

namespace braid {

struct VisibilityBatch::Panes {
  explicit Panes(const TransportContext& c) : context(c), blends(c.scene.traits().has(kTraitAlphaBlend)) {}

  enum class Crossing { Blocked, GoesOn, Arrived };
  Crossing cross(size_t ray, const RayHit& found);
  void intersect(int count);

  const TransportContext& context;
  const bool blends;
  std::array<RayQuery, kBatch> query;
  std::array<float, kBatch> index;  // refractive index around the ray
  std::array<Spectrum, kBatch> transmittance;
  std::array<int, kBatch> active;  // rays that have not arrived
  RayBatch rays;                   // in the order of `active`, like their hits
  std::array<RayHit, kBatch> hits;
  std::array<float, kBatch> passing;  // where something blends: what is left of these before their hits
};

VisibilityBatch::VisibilityBatch(const TransportContext& context) : scene_(context.scene) {
  if (scene_.traits().has(kTraitPanes)) panes_ = std::make_unique<Panes>(context);
  blends_ = !panes_ && scene_.traits().has(kTraitAlphaBlend);
}

VisibilityBatch::~VisibilityBatch() = default;

void VisibilityBatch::setIndex(int i, float index) { panes_->index[static_cast<size_t>(i)] = index; }

const Spectrum& VisibilityBatch::transmittance(int i) const { return panes_->transmittance[static_cast<size_t>(i)]; }

void VisibilityBatch::traceOpaque(int count) {
  if (blends_) passing_.fill(1);
  scene_.accel().occluded(rays_, count, hidden_.data());
}

void VisibilityBatch::trace(int count) {
  if (blends_) return scene_.accel().occluded(rays_, count, hidden_.data(), passing_.data());
  if (!panes_) return traceOpaque(count);
  Panes& p = *panes_;
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<size_t>(i);
    hidden_[k] = false;
    p.transmittance[k] = Spectrum(1);
    p.query[k] = rays_.get(i);
    p.rays.set(i, p.query[k]);
    p.active[k] = i;
  }
  int active = count;
  for (int crossed = 0; active > 0; ++crossed) {
    p.intersect(active);
    int next = 0;
    for (int a = 0; a < active; ++a) {
      const RayHit& found = p.hits[static_cast<size_t>(a)];
      const int i = p.active[static_cast<size_t>(a)];
      const auto k = static_cast<size_t>(i);
      if (p.blends) p.transmittance[k] *= p.passing[static_cast<size_t>(a)];
      if (!(found.t < kInfinity)) continue;
      const Panes::Crossing crossing = crossed + 1 < kMostPanes ? p.cross(k, found) : Panes::Crossing::Blocked;
      hidden_[k] = crossing == Panes::Crossing::Blocked;
      if (crossing != Panes::Crossing::GoesOn) continue;
      p.active[static_cast<size_t>(next)] = i;
      p.rays.set(next++, p.query[k]);
    }
    active = next;
  }
}

void VisibilityBatch::Panes::intersect(int count) {
  if (blends) return context.scene.accel().intersect(rays, count, hits.data(), passing.data());
  context.scene.accel().intersect(rays, count, hits.data());
}

// Takes a ray to the far side of the surface that it hit, if that lets it through.
VisibilityBatch::Panes::Crossing VisibilityBatch::Panes::cross(size_t ray, const RayHit& found) {
  const Scene& scene = context.scene;
  const MaterialSummary& material = context.materials[scene.mesh(found.mesh).material];
  if (!material.pane) return Crossing::Blocked;
  RayQuery& q = query[ray];
  const Vec3 direction = glm::normalize(q.direction);
  Hit hit;
  makeHit(scene, found, direction, hit);
  const Bsdf bsdf(surfaceAt(scene, hit, material.lobes, index[ray]), hit.frame.toLocal(hit.wo));
  const float cover = blends ? scene.alpha(scene.mesh(found.mesh), found.triangle, found.u, found.v) : 1;
  transmittance[ray] *= 1 - cover + cover * bsdf.straightTransmittance();
  if (isBlack(transmittance[ray])) return Crossing::Blocked;
  const Vec3 origin = offsetOrigin(hit, direction);
  q.salt &= ~kCameraRay;  // as that of a path that has passed a pane
  if (q.tmax < kInfinity) {
    // Aimed anew from the moved origin.
    q.direction = q.origin + q.direction * q.tmax - origin;
    q.tmax = 1;
    if (!(glm::dot(q.direction, direction) > 0)) return Crossing::Arrived;
  }
  q.origin = origin;
  return Crossing::GoesOn;
}

}  // namespace braid
