// SPDX-License-Identifier: Apache-2.0
// Makes a mesh safe to render: lists of triangles, no NaN, unit normals and tangents, no unused vertices.
#pragma once

#include <string>

#include "renderer/scene/data/placement.h"
#include "renderer/scene/gltf/document/gltf_report.h"
#include "renderer/scene/data/scene_data.h"

namespace braid::gltf {

// Attributes that are needed only while a mesh is built.
struct ExtraAttributes {
  std::vector<std::vector<Vec2>> uv;  // of each tangent frame
};

// The triangles of a strip, or of a fan.
std::vector<glm::uvec3> joinedTriangles(const std::vector<uint32_t>& indices, bool isStrip);

// Drops triangles with a vertex that is not finite, or beyond what the ray tracer can hold. Returns whether any are
// left.
bool dropBadTriangles(TriangleMesh& mesh, Report& report, const std::string& place);

// Removes vertices that no triangle uses.
void compactVertices(TriangleMesh& mesh, ExtraAttributes& extras);

// Normalises normals; replaces those that are zero or not finite by the average of the adjacent triangles.
void repairNormals(TriangleMesh& mesh, Report& report, const std::string& place);

// Normalises tangents; returns false, with a warning, if some are unusable.
bool repairTangents(TriangleMesh& mesh, Report& report, const std::string& place);

// Gives each triangle its own vertices with the geometric normal.
void splitIntoFlatTriangles(TriangleMesh& mesh, ExtraAttributes& extras);

// Calls visit(vector) for every per-vertex array that is not empty.
template <class Visit>
void forEachAttribute(TriangleMesh& mesh, ExtraAttributes& extras, const Visit& visit) {
  const auto present = [&](auto& array) {
    if (!array.empty()) visit(array);
  };
  present(mesh.positions);
  present(mesh.normals);
  present(mesh.tangents);
  for (auto& uv : mesh.uv) present(uv);
  present(mesh.colors);
  for (std::vector<Vec2>& uv : extras.uv) present(uv);
}

}  // namespace braid::gltf
