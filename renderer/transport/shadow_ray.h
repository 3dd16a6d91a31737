// SPDX-License-Identifier: Apache-2.0
// Rays that ask whether two points see each other, or a point a light.
#pragma once

#include "renderer/transport/hit.h"

namespace braid {

// Such rays stop this share of their length before their end, so that its own triangle does not hide it.
inline constexpr float kShadowLength = 1 - 1e-4f;

// From one point to another, both already lifted off their surfaces.
inline RayQuery connectionRay(const Vec3& from, const Vec3& to, uint32_t salt, float time) {
  return {from, to - from, kShadowLength, salt, time};
}

// From a hit to a light in the unit direction wi; the distance is infinite for directional lights and the environment.
inline void setShadowRay(const Hit& hit, const Vec3& wi, float distance, uint32_t salt, RayQuery& ray) {
  ray.origin = offsetOrigin(hit, wi);
  ray.direction = wi;
  ray.tmax = kInfinity;
  ray.salt = salt;
  ray.time = hit.time;
  if (!(distance < kInfinity)) return;
  // TRAP: aimed anew from the moved origin. On a large triangle the move is longer than the margin before a near light:
  // the light would hide itself.
  ray.direction = hit.position + wi * distance - ray.origin;
  ray.tmax = kShadowLength;
}

inline RayQuery shadowRay(const Hit& hit, const Vec3& wi, float distance, uint32_t salt) {
  RayQuery ray;
  setShadowRay(hit, wi, distance, salt, ray);
  return ray;
}

}  // namespace braid
