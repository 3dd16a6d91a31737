// SPDX-License-Identifier: Apache-2.0
// Instances and emissive triangles while the shutter is open, and what the scene's vertices take.
#include "renderer/scene/scene.h"

namespace braid {

namespace {

size_t bytesOf(const MeshVertices& v) {
  return v.positions.capacity() * sizeof(Vec3) + v.normals.capacity() * sizeof(Vec3) +
         (v.tangents.capacity() + v.otherTangents[0].capacity() + v.otherTangents[1].capacity()) * sizeof(Vec4);
}

}  // namespace

const GroupInstance& Scene::moveInstance(const GroupInstance& instance, float time, GroupInstance& moved) const {
  const std::vector<Mat4>& steps = motions_[instance.motion];
  const Moment m = momentAt(time, steps.size() - 1);
  moved = instance;
  moved.toWorld = between(steps[m.first], steps[m.first + 1], m.fraction);
  moved.toObject = glm::inverse(moved.toWorld);
  return moved;
}

const EmissiveTriangle& Scene::moveEmitter(const EmissiveTriangle& emitter, float time, EmissiveTriangle& moved) const {
  moved = emitter;
  const TriangleMesh& mesh = data_.meshes[emitter.mesh];
  const glm::uvec3& index = mesh.triangles[emitter.triangle];
  Vec3 corners[3];
  if (mesh.moves()) {
    const Moment m = momentAt(time, mesh.steps.size());
    const MeshVertices &a = mesh.step(m.first), &b = mesh.step(m.first + 1);
    for (int k = 0; k < 3; ++k) corners[k] = between(a.positions[index[k]], b.positions[index[k]], m.fraction);
  } else {
    for (int k = 0; k < 3; ++k) corners[k] = mesh.positions[index[k]];
  }
  bool mirrored = false;
  if (emitter.instance != kNoInstance) {
    GroupInstance storage;
    const Mat4& toWorld = instanceAt(emitter.instance, time, storage).toWorld;
    for (Vec3& corner : corners) corner = Vec3(toWorld * Vec4(corner, 1));
    mirrored = glm::determinant(Mat3(toWorld)) < 0;
  }
  setShape(moved, corners, mirrored);
  return moved;
}

void Scene::averageOverSteps(EmissiveTriangle& emitter) const {
  const size_t segments = data_.motion.times.size() - 1;
  float sum = 0;
  EmissiveTriangle moved;
  for (size_t k = 0; k <= segments; ++k)
    sum += moveEmitter(emitter, static_cast<float>(k) / static_cast<float>(segments), moved).area;
  emitter.area = sum / static_cast<float>(segments + 1);
}

Scene::Sweep Scene::sweepOf(const EmissiveTriangle& emitter) const {
  Sweep sweep;
  const size_t segments = emitter.moves ? data_.motion.times.size() - 1 : 0;
  for (size_t k = 0; k <= segments; ++k) {
    EmissiveTriangle moved = emitter;
    if (emitter.moves) moveEmitter(emitter, static_cast<float>(k) / static_cast<float>(segments), moved);
    for (const Vec3& p : {moved.p0, moved.p0 + moved.e1, moved.p0 + moved.e2}) sweep.bounds.extend(p);
    sweep.turns = sweep.turns || !(glm::dot(moved.normal, emitter.normal) > 1 - 1e-6f);
  }
  sweep.turns = emitter.moves && sweep.turns;
  return sweep;
}

size_t Scene::geometryBytes() const {
  size_t bytes = instances_.size() * sizeof(GroupInstance) + emitters_.size() * sizeof(EmissiveTriangle);
  for (const std::vector<Mat4>& steps : motions_) bytes += steps.capacity() * sizeof(Mat4);
  for (const TriangleMesh& m : data_.meshes) {
    bytes += bytesOf(m) + m.triangles.capacity() * sizeof(glm::uvec3) + m.colors.capacity() * sizeof(Vec4);
    for (const MeshVertices& step : m.steps) bytes += bytesOf(step);
    for (const std::vector<Vec2>& uv : m.uv) bytes += uv.capacity() * sizeof(Vec2);
  }
  return bytes;
}

}  // namespace braid
