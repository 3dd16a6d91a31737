// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/placement.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

struct DoubleBounds {
  glm::dvec3 lo{std::numeric_limits<double>::infinity()}, hi{-std::numeric_limits<double>::infinity()};
  void extend(const glm::dvec3& p) {
    lo = glm::min(lo, p);
    hi = glm::max(hi, p);
  }
  bool empty() const { return !(lo.x <= hi.x); }
  glm::dvec3 centre() const { return 0.5 * lo + 0.5 * hi; }
  double radius() const { return 0.5 * glm::length(hi - lo); }
  bool isFar() const { return !empty() && glm::length(centre()) > kFarInRadii * radius(); }
};

DoubleBounds boundsOf(const TriangleMesh& mesh) {
  DoubleBounds bounds;
  for (const Vec3& p : mesh.positions) bounds.extend(glm::dvec3(p));
  return bounds;
}

}  // namespace

Shape shapeOf(const glm::dmat4& transform) {
  const glm::dmat3 linear(transform), plane = cofactors(linear);
  const double longest = std::max({glm::length(linear[0]), glm::length(linear[1]), glm::length(linear[2])});
  const double widest = std::max({glm::length(plane[0]), glm::length(plane[1]), glm::length(plane[2])});
  if (!std::isfinite(longest) || !(longest > 1e-18 && longest < 1e18)) return Shape::Gone;
  if (std::abs(glm::determinant(linear)) > 1e-18 * longest * longest * longest) return Shape::Solid;
  return widest > 1e-12 * longest * longest ? Shape::Flat : Shape::Gone;
}

glm::dmat3 axesOf(const glm::dmat4& transform) {
  glm::dmat3 axes(transform);
  const double longest = std::max({glm::length(axes[0]), glm::length(axes[1]), glm::length(axes[2])});
  for (int i = 0; i < 3; ++i) {
    if (glm::length(axes[i]) > 1e-12 * longest) continue;
    axes[i] = glm::cross(axes[(i + 1) % 3], axes[(i + 2) % 3]);
    break;
  }
  return axes;
}

namespace {

bool mirrors(const Mat4& m) { return shapeOf(glm::dmat4(m)) == Shape::Solid && glm::determinant(Mat3(m)) < 0; }

void transformVertices(MeshVertices& mesh, const Mat4& toWorld, bool mirrored) {
  const Mat3 linear(toWorld);
  const bool isFlat = shapeOf(glm::dmat4(toWorld)) != Shape::Solid;
  const Mat3 normalMatrix = isFlat ? cofactors(linear) : glm::transpose(glm::inverse(linear));
  parallelChunks(mesh.positions.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) mesh.positions[i] = Vec3(toWorld * Vec4(mesh.positions[i], 1));
  });
  for (Vec3& n : mesh.normals) {
    const Vec3 transformed = normalMatrix * n;
    const float length = glm::length(transformed);
    if (length > 0) n = transformed / length;
    if (isFlat && !(length > 0)) n = Vec3(0);  // of a side seen edge on; shading takes the triangle's
  }
  for (std::vector<Vec4>* tangents : {&mesh.tangents, &mesh.otherTangents[0], &mesh.otherTangents[1]}) {
    for (Vec4& t : *tangents) {
      const Vec3 transformed = linear * Vec3(t);
      const float length = glm::length(transformed);
      if (length > 0) t = Vec4(transformed / length, mirrored ? -t.w : t.w);
    }
  }
}

void turnWinding(TriangleMesh& mesh) {
  for (glm::uvec3& t : mesh.triangles) std::swap(t.y, t.z);
}

}  // namespace

void transformMesh(TriangleMesh& mesh, const Mat4& toWorld) {
  if (toWorld == Mat4(1)) return;
  const bool mirrored = mirrors(toWorld);
  transformVertices(mesh, toWorld, mirrored);
  if (mirrored) turnWinding(mesh);
}

void transformMesh(TriangleMesh& mesh, const Mat4& toWorld, const std::vector<Mat4>& steps) {
  if (steps.empty()) {
    const bool mirrored = mirrors(toWorld);
    for (MeshVertices& step : mesh.steps) transformVertices(step, toWorld, mirrored);
    return transformMesh(mesh, toWorld);
  }
  if (!mesh.moves()) mesh.steps.assign(steps.size(), mesh);
  const auto solid =
      std::find_if(steps.begin(), steps.end(), [](const Mat4& m) { return shapeOf(glm::dmat4(m)) == Shape::Solid; });
  const bool decidedAtOnce = shapeOf(glm::dmat4(toWorld)) == Shape::Solid || solid == steps.end();
  const bool mirrored = mirrors(decidedAtOnce ? toWorld : *solid);
  transformVertices(mesh, toWorld, mirrored);
  for (size_t k = 0; k < steps.size(); ++k) transformVertices(mesh.steps[k], steps[k], mirrored);
  if (mirrored) turnWinding(mesh);
}

glm::dvec3 originFor(const SceneData& scene, const std::vector<glm::dmat4>& transforms, const glm::dvec3& suggestion) {
  std::vector<DoubleBounds> local;
  for (const TriangleMesh& mesh : scene.meshes) local.push_back(boundsOf(mesh));
  DoubleBounds bounds;
  for (size_t i = 0; i < transforms.size(); ++i) {
    const DoubleBounds& b = local[scene.instances[i].mesh];
    if (b.empty()) continue;
    for (int k = 0; k < 8; ++k) {
      const glm::dvec3 corner(k & 1 ? b.hi.x : b.lo.x, k & 2 ? b.hi.y : b.lo.y, k & 4 ? b.hi.z : b.lo.z);
      bounds.extend(glm::dvec3(transforms[i] * glm::dvec4(corner, 1)));
    }
  }
  if (!bounds.isFar()) return glm::dvec3(0);
  // Taken away, the transform that carries the whole scene off leaves the numbers that it was made with.
  const bool isNear = glm::length(suggestion - bounds.centre()) <= kFarInRadii / 4 * bounds.radius();
  return isNear ? suggestion : bounds.centre();
}

void bringVerticesNear(SceneData& scene, std::vector<glm::dmat4>& transforms,
                       std::vector<std::vector<glm::dmat4>>& steps, const glm::dvec3& origin) {
  std::vector<std::vector<size_t>> placements(scene.meshes.size());
  for (size_t i = 0; i < scene.instances.size(); ++i) placements[scene.instances[i].mesh].push_back(i);
  for (size_t m = 0; m < scene.meshes.size(); ++m) {
    TriangleMesh& mesh = scene.meshes[m];
    const DoubleBounds bounds = boundsOf(mesh);
    if (placements[m].empty() || !bounds.isFar()) continue;
    // The same point for all meshes under one transform: what they share stays shared.
    const glm::dmat4& first = transforms[placements[m].front()];
    const glm::dvec3 shift =
        shapeOf(first) == Shape::Solid ? glm::dvec3(glm::inverse(first) * glm::dvec4(origin, 1)) : bounds.centre();
    for (Vec3& p : mesh.positions) p = Vec3(glm::dvec3(p) - shift);
    for (MeshVertices& step : mesh.steps)
      for (Vec3& p : step.positions) p = Vec3(glm::dvec3(p) - shift);
    for (const size_t i : placements[m]) {
      transforms[i] = glm::translate(transforms[i], shift);
      for (glm::dmat4& step : steps[i]) step = glm::translate(step, shift);
    }
  }
}

}  // namespace braid
