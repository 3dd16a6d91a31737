// SPDX-License-Identifier: Apache-2.0
// Small scenes of cubes, quads and lamps, and single rays in them.
#pragma once

#include <utility>
#include <vector>

#include "tools/bench/builtin_scenes.h"

namespace braid::test::scene_shapes {

// A cube of side 2 about the origin; faces look outward unless `inward`. Each face has vertices of its own, with flat
// normals, when `split`.
inline TriangleMesh cube(bool inward = false, bool split = false, int faces = 6) {
  TriangleMesh mesh;
  for (int face = 0; face < faces; ++face) {
    const int axis = face / 2;
    const float side = face % 2 ? 1.0f : -1.0f;
    Vec3 n(0), a(0), b(0);
    n[axis] = side;
    a[(axis + 1) % 3] = 2;
    b[(axis + 2) % 3] = 2 * side;
    if (inward) std::swap(a, b);
    addQuad(mesh, n - 0.5f * a - 0.5f * b, a, b);
    if (split)
      for (int k = 0; k < 4; ++k) mesh.normals.push_back(n);
  }
  return mesh;
}

inline TriangleMesh quad(const Vec3& p, const Vec3& a, const Vec3& b) {
  TriangleMesh mesh;
  addQuad(mesh, p, a, b);
  return mesh;
}

inline Material singleSided(Material m = diffuseMaterial(Spectrum(0.5f))) {
  m.doubleSided = false;
  return m;
}

inline SceneData oneMesh(TriangleMesh mesh, const Material& material) {
  SceneData data;
  data.materials = {material};
  addMesh(data, std::move(mesh), 0);
  return data;
}

// Traces up to kBatch rays together.
inline std::vector<RayHit> intersectAll(const Scene& scene, const std::vector<RayQuery>& rays) {
  RayBatch batch;
  for (size_t i = 0; i < rays.size(); ++i) batch.set(static_cast<int>(i), rays[i]);
  std::vector<RayHit> hits(rays.size());
  scene.accel().intersect(batch, static_cast<int>(rays.size()), hits.data());
  return hits;
}

inline RayHit intersect(const Scene& scene, const Vec3& origin, const Vec3& direction) {
  return intersectAll(scene, {{origin, direction}})[0];
}

inline Mat4 turned(const Vec3& at, float angle, const Vec3& axis, const Vec3& scale) {
  return glm::scale(glm::rotate(glm::translate(Mat4(1), at), angle, glm::normalize(axis)), scale);
}

// A lamp of its own, and a group of two meshes, one of them emissive, placed three times, once mirrored.
inline SceneData lampsAndInstances() {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.5f)), diffuseMaterial(Spectrum(0), Spectrum(3, 2, 1))};
  addMesh(data, quad({0, 20, 0}, {1, 0, 0}, {0, 0, 1}), 1);
  TriangleMesh body = cube(), lamp = quad({-1, -1, 1.5f}, {2, 0, 0}, {0, 2, 0});
  lamp.material = 1;
  data.meshes.push_back(body);
  data.meshes.push_back(lamp);
  const Mat4 placements[] = {turned({5, 0, 0}, 0.4f, {1, 2, 3}, Vec3(1)),
                             turned({-5, 0, 0}, 2, {0, 1, 0}, {1, 2, 0.5f}),
                             turned({0, 0, 9}, 1, {1, 0, 1}, {-1, 1, 1})};
  for (const Mat4& m : placements)
    for (const uint32_t mesh : {1u, 2u}) data.instances.push_back({mesh, m, {}});
  return data;
}

}  // namespace braid::test::scene_shapes
