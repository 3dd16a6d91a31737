// SPDX-License-Identifier: Apache-2.0
// Faces that stand back to back in one place, as exporters write both sides of a wall. Of the two a ray meets the one
// that faces it; which one Embree reports is up to rounding and to the order of triangles.
#pragma once

#include <cstdint>
#include <vector>

#include "renderer/scene/accel.h"

namespace braid {

class CoincidentFaces {
 public:
  // Looks for opaque triangles of which another one, facing the other way, lies in the same plane, in linear time.
  // `reachable`, per mesh: whether rays may meet its back faces; `opaque`: whether no light passes its surface.
  // Repeated meshes are compared up to kMostPlaced triangles in all; beyond that they are left out, as is what moves
  // while the shutter is open.
  CoincidentFaces(const AccelInput& input, const std::vector<uint8_t>& reachable, const std::vector<uint8_t>& opaque);
  static constexpr uint64_t kMostPlaced = uint64_t(1) << 18;

  // Scenes without such faces pay for nothing.
  bool any() const { return !faces_.empty(); }

  // The triangles that may be found, as a list of its own: Face k has the corners 3k, 3k + 1, 3k + 2 in the world.
  struct Face {
    uint32_t mesh, triangle, instance;
    bool mirrored;  // its front is where its corners turn clockwise
    auto operator<=>(const Face&) const = default;
  };
  const std::vector<Face>& faces() const { return faces_; }
  const std::vector<Vec3>& corners() const { return corners_; }
  const std::vector<glm::uvec3>& triangles() const { return triangles_; }

  // How far along the ray, before and behind the hit, a face in the same place may be found: what the distances of both
  // can be off by rounding. 0: the hit faces the ray, or nothing can lie there.
  float reach(const RayQuery& ray, const RayHit& hit) const;

  // Whether what was found within reach of `back` stands back to back with it.
  bool pairs(const RayHit& back, const RayHit& found) const;

 private:
  struct Triangle {
    Vec3 p[3];
    bool mirrored;
  };
  struct Placed {
    uint32_t mesh, instance;
  };
  Triangle triangleOf(uint32_t mesh, uint32_t triangle, uint32_t instance) const;
  Triangle triangleOf(const RayHit& hit) const { return triangleOf(hit.mesh, hit.triangle, hit.instance); }
  class Search;
  void look(const std::vector<Placed>& placed);
  void listFaces();

  const std::vector<TriangleMesh>& meshes_;
  const std::vector<GroupInstance>& instances_;
  std::vector<uint8_t> reachable_, opaque_;  // per mesh
  std::vector<std::vector<bool>> suspect_;   // per mesh, per triangle: may have a face behind it; empty: none
  std::vector<Face> faces_;
  std::vector<Vec3> corners_;
  std::vector<glm::uvec3> triangles_;
};

}  // namespace braid
