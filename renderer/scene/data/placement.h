// SPDX-License-Identifier: Apache-2.0
// Placing meshes in the world: what a transform leaves of them, baking it in, and scenes far from the zero of their
// file's coordinates.
#pragma once

#include <vector>

#include "renderer/scene/data/scene_data.h"

namespace braid {

// What is left of a solid thing: Flat: pressed into a plane, by a scale of 0 along one axis; Gone: into a line or a
// point, or not finite.
enum class Shape { Solid, Flat, Gone };
Shape shapeOf(const glm::dmat4& transform);

// Normals go by the cofactors of a transform: the inverse transpose times the determinant, but defined where there is
// no inverse.
template <class T>
glm::mat<3, 3, T> cofactors(const glm::mat<3, 3, T>& m) {
  return {glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1])};
}

inline Vec3 normalizedOr(const Vec3& v, const Vec3& fallback) {
  // In double: the square of a small or large float is out of range.
  const glm::dvec3 d(v);
  const double length = glm::length(d);
  return length > 1e-6 && length < 1e18 ? Vec3(d / length) : fallback;
}

// The axes of a camera or light: one that is flattened away is made from the two others.
glm::dmat3 axesOf(const glm::dmat4& transform);

// Bakes a transform into a mesh. A mirrored mesh has its winding turned so that the cross product of the edges keeps
// pointing to the front.
void transformMesh(TriangleMesh& mesh, const Mat4& toWorld);

// The same with a transform for each of the `steps` after it: every step of the mesh gets its own. Whether it is
// mirrored is decided by the first transform that leaves it solid; the front sides of others are theirs.
void transformMesh(TriangleMesh& mesh, const Mat4& toWorld, const std::vector<Mat4>& steps);

// Floats are too coarse for scenes that lie more than this many of their own radii from zero.
inline constexpr double kFarInRadii = 64;

// A zero for a scene whose instances are placed by `transforms` (in the coordinates of the file, one for each
// instance): zero itself unless all that is drawn lies far from it; then `suggestion` if that is near, else the centre.
glm::dvec3 originFor(const SceneData& scene, const std::vector<glm::dmat4>& transforms, const glm::dvec3& suggestion);

// Moves the vertices of meshes that lie far from their own zero to where `origin` is in their coordinates, and corrects
// their transforms, those of `steps` too (of each instance at the steps of the scene's motion; empty: it stands still).
void bringVerticesNear(SceneData& scene, std::vector<glm::dmat4>& transforms,
                       std::vector<std::vector<glm::dmat4>>& steps, const glm::dvec3& origin);

// The same transform with results relative to `origin`.
inline Mat4 relativeTo(glm::dmat4 transform, const glm::dvec3& origin) {
  transform[3] -= glm::dvec4(origin, 0);
  return Mat4(transform);
}

}  // namespace braid
