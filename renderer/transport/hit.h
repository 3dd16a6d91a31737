// SPDX-License-Identifier: Apache-2.0
// A surface point as transport sees it: position with its rounding error bound, geometric and shading normals, and the
// material there.
#pragma once

#include <span>

#include "renderer/core/vec.h"
#include "renderer/scene/scene.h"
#include "renderer/transport/bsdf/surface.h"

namespace braid {

struct Hit {
  Vec3 position;
  float positionError;  // bound of the rounding error of the position and of ray queries there, metres
  Vec3 wo;              // unit, back along the ray
  Vec3 ng;              // unit geometric normal on the side of wo
  Frame frame;          // shading frame; n is the shading normal, on the front side when `front`, else turned with ng
  Vec3 smoothNormal;    // interpolated normal without the normal map, oriented like frame.n
  float distance = 0;   // metres from the ray origin
  bool front = true;    // wo lies on the front side of the triangle
  float u = 0, v = 0;
  float time = 0;  // of the ray
  uint32_t meshIndex = 0, triangle = 0, instance = kNoInstance;
  const TriangleMesh* mesh = nullptr;
  const Material* material = nullptr;
};

// Fills `hit` from a ray query with a unit direction.
void makeHit(const Scene& scene, const RayHit& query, const Vec3& direction, Hit& hit);

// Fetches the vertices of what rays have hit while nothing waits for them.
void prefetchVertices(const Scene& scene, std::span<const RayHit> queries);

// Lifts a point off its surface, along the normal and to the side that `direction` points to, by just more than the
// point's error bound, so that a ray from there cannot hit the surface it leaves: no fixed epsilon, so 2 cm and 1600 m
// scenes both work.
BRAID_INLINE Vec3 offsetOrigin(const Vec3& position, float error, const Vec3& ng, const Vec3& direction) {
  const float reach = 2 * error * (std::abs(ng.x) + std::abs(ng.y) + std::abs(ng.z));
  return position + std::copysign(reach, glm::dot(direction, ng)) * ng;
}
BRAID_INLINE Vec3 offsetOrigin(const Hit& hit, const Vec3& direction) {
  return offsetOrigin(hit.position, hit.positionError, hit.ng, direction);
}

// Evaluates the material at a hit: textures, vertex colours and factors. `lobes` = materialLobes(); etaOutside is the
// index around it.
SurfaceParameters surfaceAt(const Scene& scene, const Hit& hit, uint32_t lobes, float etaOutside);

// The base colour at a hit, without alpha.
Spectrum baseColorAt(const Scene& scene, const Hit& hit);

// What an emissive surface sends back along the ray that hit it, black behind a single-sided one.
Spectrum emissionAt(const Scene& scene, const Hit& hit);

}  // namespace braid
