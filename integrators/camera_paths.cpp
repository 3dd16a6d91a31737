// SPDX-License-Identifier: Apache-2.0
#include "integrators/camera_paths.h"

#include "renderer/session/pixel_filter.h"

namespace braid {

Camera::CameraRay cameraRayThrough(const Plan& plan, const SampleBlock& camera, int x, int y, float time) {
  const PixelFilter filter = plan.settings.filter;
  Vec2 offset(camera.u[slot::kPixelX] - 0.5f, camera.u[slot::kPixelY] - 0.5f);
  if (filter != PixelFilter::Box)
    offset = {sampleFilter(filter, camera.u[slot::kPixelX]), sampleFilter(filter, camera.u[slot::kPixelY])};
  const CameraAt at(plan.camera, time);
  const Vec3 lens = at->lensPoint({camera.u[slot::kLensU], camera.u[slot::kLensV]});
  Camera::CameraRay ray = at->rayFrom(lens, Vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f) + offset);
  ray.time = time;
  return ray;
}

void surfaceFeatures(const Scene& scene, const Hit& hit, const Bsdf& bsdf, float distance, FeatureSample& features) {
  Spectrum albedo = bsdf.albedo();
  // White as far as its texture shines, however strong it is: no unit of light changes what filters see.
  if (hit.material->emissive())
    albedo +=
        maxComponent(scene.emission(*hit.mesh, hit.triangle, hit.u, hit.v)) / maxComponent(hit.material->emission);
  features.setAlbedo(albedo);
  features.normal = hit.frame.n;
  features.depth = distance;
}

void unlitFeatures(const Spectrum& color, const Hit& hit, float distance, FeatureSample& features) {
  features.setAlbedo(color);
  features.normal = hit.frame.n;
  features.depth = distance;
}

bool recordFeatures(const Scene& scene, const SubpathVertex& vertex, int maxDepth, PathSample& sample) {
  const bool goesOn = vertex.segments < maxDepth || vertex.bsdf.passesStraight();
  if (!vertex.bsdf.hasNonDelta() && goesOn && !vertex.hit.material->scatters()) return false;
  surfaceFeatures(scene, vertex.hit, vertex.bsdf, vertex.travelled, sample.features);
  sample.leastLobe = vertex.leastLobe;
  return true;
}

Spectrum unlitColor(const Scene& scene, const SubpathVertex& vertex, bool record, PathSample& sample) {
  const Spectrum color = baseColorAt(scene, vertex.hit);
  if (!record) return color;
  unlitFeatures(color, vertex.hit, vertex.travelled, sample.features);
  sample.leastLobe = vertex.leastLobe;
  return color;
}

std::optional<LightHit> lightAt(const Scene& scene, const Hit& hit) {
  const int64_t emitter = scene.emitterIndex(hit.meshIndex, hit.triangle, hit.instance);
  const float cosine = glm::dot(hit.wo, hit.ng);
  if (emitter < 0 || !(cosine > 0)) return std::nullopt;
  return LightHit{static_cast<uint32_t>(emitter), cosine};
}

Spectrum radianceBeyond(const Scene& scene, const Plan& plan, const Vec3& direction, bool fromCamera, bool record,
                        float leastLobe, PathSample& sample) {
  if (fromCamera) sample.coverage = 0;
  Spectrum radiance(0);
  if (fromCamera && plan.settings.background) {
    radiance = *plan.settings.background;
  } else if (scene.environment()) {
    radiance = scene.environment()->radiance(direction);
  }
  if (plan.kept.features && record) {
    sample.features.setAlbedo(radiance);
    sample.features.normal = -direction;
    sample.features.depth = 0;
    sample.leastLobe = leastLobe;
  }
  return fromCamera && plan.settings.transparent ? Spectrum(0) : radiance;
}

}  // namespace braid
