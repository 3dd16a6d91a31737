// SPDX-License-Identifier: Apache-2.0
// Points as spheres and lines as capsules: triangles, so that everything that holds for surfaces holds for them.
#pragma once

#include <vector>

#include "renderer/scene/data/scene_data.h"

namespace braid {

// From fine to coarse. Radii are such that polyhedra have the surface of the sphere and prisms the girth of the
// cylinder: by Cauchy's formula the area that is seen is right in the mean over all directions at every level.
inline constexpr int kRoundLevels = 4;
uint64_t trianglesOfSphere(int level);   // 320, 80, 20, 8
uint64_t trianglesOfCapsule(int level);  // 256, 80, 20, 12

struct RoundShape {
  float radius = 0;       // metres in the world; 0: nothing is drawn
  int level = 0;          // below kRoundLevels
  glm::dmat3 toWorld{1};  // of the coordinates of the vertices, invertible: shapes are round behind it
};

// What a primitive of points or lines draws: vertices, and pairs of them.
struct Strokes {
  std::vector<uint32_t> points;
  std::vector<glm::uvec2> segments;
  bool empty() const { return points.empty() && segments.empty(); }
};

// Of glTF's modes 0 (points, each once), 1 (pairs), 2 (a loop) and 3 (a strip). Left out is what has a vertex that does
// not exist or is not finite; `lost` counts it.
Strokes strokesOf(int mode, const std::vector<uint32_t>& indices, const std::vector<Vec3>& positions, uint64_t& lost);

// The spheres and capsules about the vertices of `spine`, whose positions, colours and texture coordinates are read;
// with smooth normals, closed, in the coordinates of the vertices.
TriangleMesh roundMesh(const TriangleMesh& spine, const Strokes& strokes, const RoundShape& shape);

// The RoundShape::toWorld by which instances can share triangles: rotations do not matter where the scale is uniform.
glm::dmat3 roundFrame(const glm::dmat3& linear);

}  // namespace braid
