// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/media.h"

#include "renderer/transport/hit.h"

namespace braid {

MediaStack mediaAround(const Scene& scene, const Vec3& point, const Vec3& direction, float time) {
  constexpr int kMaxCrossings = 256;
  MediaStack around, entered;
  Vec3 origin = point;
  for (int i = 0; i < kMaxCrossings; ++i) {
    RayBatch ray;
    RayHit query;
    ray.set(0, {origin, direction, kInfinity, 0, time});
    scene.accel().intersect(ray, 1, &query);
    if (!(query.t < kInfinity)) break;
    Hit hit;
    makeHit(scene, query, direction, hit);
    if (hit.material->hasVolume()) {
      if (hit.front)
        entered.enter(hit.mesh->material);
      else if (!entered.leave(hit.mesh->material))
        around.enter(hit.mesh->material);
    }
    origin = offsetOrigin(hit, direction);
  }
  return around;
}

MediaStack mediaOfCamera(const Scene& scene, const Camera& camera, float time) {
  if (!scene.traits().has(kTraitVolume)) return {};
  const CameraAt at(camera, time);
  return mediaAround(scene, at->position(), at->forward(), time);
}

}  // namespace braid
