// SPDX-License-Identifier: Apache-2.0
#include "integrators/sppm/sppm_gather.h"

#include <algorithm>
#include <cmath>

namespace braid {

namespace {

constexpr float kSmallest = 1e-7f, kLargest = 0.05f;  // of the scene's radius
// Photons of a surface that faces elsewhere belong to another wall. As a cosine.
constexpr float kSameSurface = 0.1f;

// Sums scattering(photon, local direction) times the photon's power.
template <class Grid, class Scattering>
PhotonSum gather(const Grid& grid, const SubpathVertex& vertex, float radius, int maxSegments,
                 const Scattering& scattering) {
  PhotonSum sum;
  const Hit& hit = vertex.hit;
  const float inner2 = kInnerArea * sqr(radius);
  grid.query(hit.position, radius, [&](const auto& photon, float distance2) {
    ++sum.photons;
    if (photon.segments > maxSegments) return;
    const Vec3 wi = unpackDirection(photon.direction, 16);
    const Vec3 local = hit.frame.toLocal(wi);
    const bool reflects = local.z > 0;
    // As for light samples: the light's side must agree with both normals.
    if (reflects != (glm::dot(wi, hit.ng) > 0) || (!reflects && !vertex.twoSided)) return;
    const float facing = glm::dot(unpackDirection(photon.normal, 8), hit.frame.n);
    if (!((reflects ? facing : -facing) >= kSameSurface)) return;
    const Spectrum value = scattering(photon, local) * photon.power;
    (distance2 < inner2 ? sum.inner : sum.outer) += value;
  });
  return sum;
}

}  // namespace

float radiusShrinkage(uint64_t pass) {
  constexpr double kAlpha = 2.0 / 3.0;
  return static_cast<float>(std::pow(static_cast<double>(pass / 4 + 1), -0.5 * (1 - kAlpha)));
}

RadiusScale gatherRadii(const Plan& plan, const SceneTraits& traits, uint64_t pass, float time) {
  const float shrink = radiusShrinkage(pass);
  RadiusScale s;
  s.camera = CameraAt(plan.camera, time)->position();
  s.perspective = !plan.camera.orthographic();
  const double pixel = 1 / std::sqrt(plan.camera.pixelPdf(plan.camera.forward()));
  s.smallest = std::max(kSmallest * traits.radius, 1e-30f);
  s.largest = std::max(kLargest * traits.radius * shrink, s.smallest);
  s.perMetre = plan.settings.photonRadius * static_cast<float>(pixel) * shrink;
  return s;
}

GatheredLight gatheredLight(const PhotonSum& sum, double lightPaths, float radius) {
  const double area = static_cast<double>(kPi) * sqr(static_cast<double>(radius));
  const auto scale = static_cast<float>(1 / (lightPaths * area));
  // The bias of a constant kernel grows with its area, so the excess over the inner disc is this share of it
  // (integrators/README.md, Bias of photon maps).
  const Spectrum all = sum.inner + sum.outer;
  return {all * scale, (all - sum.inner / kInnerArea) * (scale / (1 - kInnerArea))};
}

PhotonSum gatherPhotons(const PhotonGrid& grid, const SubpathVertex& vertex, float radius, int maxSegments) {
  return gather(grid, vertex, radius, maxSegments,
                [&](const Photon&, const Vec3& wi) { return vertex.bsdf.evaluate(wi).f; });
}

PhotonSum gatherCaustics(const CausticMerging& merging, const SubpathVertex& vertex, const Bsdf& narrow, float choice,
                         float radius, int maxSegments) {
  const double density = merging.density(radius) / static_cast<double>(choice);
  return gather(merging.grid, vertex, radius, maxSegments, [&](const CausticPhoton& photon, const Vec3& wi) {
    const BsdfValue value = narrow.evaluate(wi);
    const double hit = static_cast<double>(value.pdfW) * static_cast<double>(photon.hitDensity) / density;
    return value.f * static_cast<float>(1 / (1 + sqr(hit)));
  });
}

}  // namespace braid
