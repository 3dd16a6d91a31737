// SPDX-License-Identifier: Apache-2.0
// Morphs and skins while the shutter is open: the mesh is built at every step, and its vertices are kept.
#include "renderer/scene/gltf/gltf_mesh.h"

namespace braid::gltf {

namespace {

bool sameLayout(const TriangleMesh& a, const TriangleMesh& b) {
  return a.triangles == b.triangles && a.positions.size() == b.positions.size() &&
         a.normals.size() == b.normals.size() && a.tangents.size() == b.tangents.size() &&
         a.otherTangents[0].size() == b.otherTangents[0].size() &&
         a.otherTangents[1].size() == b.otherTangents[1].size();
}

}  // namespace

TriangleMesh buildMovingMesh(const Document& document, const MeshJob& job, Report& report) {
  TriangleMesh mesh = buildMesh(document, job, report);
  if (mesh.triangles.empty()) return mesh;
  MeshJob step = job;
  for (const MeshPose& pose : job.later) {
    static_cast<MeshPose&>(step) = pose;
    Report told;  // by the first one
    TriangleMesh moved = buildMesh(document, step, told);
    if (!sameLayout(mesh, moved)) {
      report.warn(job.place,
                  "a morphed or skinned mesh has other triangles at another moment; it stands still while the shutter "
                  "is open");
      mesh.steps.clear();
      break;
    }
    mesh.steps.push_back(std::move(static_cast<MeshVertices&>(moved)));
  }
  mesh.padForEmbree();
  return mesh;
}

}  // namespace braid::gltf
