// SPDX-License-Identifier: Apache-2.0
// Scenes in which things move while the shutter is open.
#pragma once

#include "tests/support/render_fixture.h"

namespace braid::test {

// How a mesh is told to move.
enum class Moved { ByVertices, ByInstance, ByInstances };

// A mesh of the material moved along the ways, each from its start to the next. ByInstances: a second one stands far
// behind the camera.
inline void addMoving(SceneData& data, TriangleMesh mesh, uint32_t material, const std::vector<Vec3>& ways, Moved how) {
  addMesh(data, std::move(mesh), material);
  TriangleMesh& added = data.meshes.back();
  MeshInstance& instance = data.instances.back();
  for (size_t k = 1; k < ways.size(); ++k) {
    if (how == Moved::ByVertices) {
      MeshVertices step = added;
      for (Vec3& p : step.positions) p += ways[k];
      added.steps.push_back(std::move(step));
    } else {
      instance.steps.push_back(glm::translate(Mat4(1), ways[k]));
    }
  }
  for (Vec3& p : added.positions)
    if (how == Moved::ByVertices) p += ways[0];
  if (how != Moved::ByVertices) instance.toWorld = glm::translate(Mat4(1), ways[0]);
  if (how == Moved::ByInstances) data.instances.push_back({instance.mesh, glm::translate(Mat4(1), Vec3(0, 0, 50)), {}});
}

// Times that are evenly spaced over the shutter.
inline SceneMotion evenMotion(size_t pieces, double seconds = 1) {
  SceneMotion motion;
  motion.seconds = seconds;
  for (size_t k = 0; k <= pieces; ++k) motion.times.push_back(static_cast<float>(k) / static_cast<float>(pieces));
  return motion;
}

// The share of its seconds for which something from `left` to `right`, moved by `way` to the right, covers x.
inline double coverage(double x, double left, double right, double way) {
  const auto clamped = [](double t) { return std::clamp(t, 0.0, 1.0); };
  return clamped((x - left) / way) - clamped((x - right) / way);
}

// Its mean over a pixel.
inline double pixelCoverage(double from, double to, double left, double right, double way) {
  constexpr int kParts = 1000;
  double sum = 0;
  for (int i = 0; i < kParts; ++i) sum += coverage(from + (to - from) * (i + 0.5) / kParts, left, right, way);
  return sum / kParts;
}

}  // namespace braid::test
