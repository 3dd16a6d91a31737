// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/mesh_repair.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace braid::gltf {

namespace {

// Embree's own limit is near 1.8e18; this leaves room for scaling by node transforms.
constexpr float kLargestCoordinate = 1e17f;

bool isUsable(const Vec3& p) {
  return std::abs(p.x) < kLargestCoordinate && std::abs(p.y) < kLargestCoordinate && std::abs(p.z) < kLargestCoordinate;
}

glm::dvec3 areaNormal(const TriangleMesh& mesh, const glm::uvec3& t) {
  const glm::dvec3 a(mesh.positions[t.x]), b(mesh.positions[t.y]), c(mesh.positions[t.z]);
  return glm::cross(b - a, c - a);
}

glm::dvec3 unitOrZero(const glm::dvec3& v) {
  const double length = glm::length(v);
  return length > 0 ? v / length : glm::dvec3(0);
}

}  // namespace

std::vector<glm::uvec3> joinedTriangles(const std::vector<uint32_t>& indices, bool isStrip) {
  std::vector<glm::uvec3> triangles;
  for (size_t i = 0; i + 2 < indices.size(); ++i) {
    const size_t odd = isStrip ? i % 2 : 0;
    if (isStrip)
      triangles.push_back({indices[i], indices[i + 1 + odd], indices[i + 2 - odd]});
    else
      triangles.push_back({indices[i + 1], indices[i + 2], indices[0]});
  }
  return triangles;
}

bool dropBadTriangles(TriangleMesh& mesh, Report& report, const std::string& place) {
  const auto isBad = [&](const glm::uvec3& t) {
    return !isUsable(mesh.positions[t.x]) || !isUsable(mesh.positions[t.y]) || !isUsable(mesh.positions[t.z]);
  };
  const uint64_t bad = std::erase_if(mesh.triangles, isBad);
  if (bad > 0) report.warn(place, "a triangle with a position that is not finite, or beyond 1e17, is dropped", bad);
  uint64_t flat = 0;
  for (const glm::uvec3& t : mesh.triangles) flat += areaNormal(mesh, t) == glm::dvec3(0);
  if (flat > 0) report.warn(place, "a triangle has no area and stays invisible", flat);
  return !mesh.triangles.empty();
}

void compactVertices(TriangleMesh& mesh, ExtraAttributes& extras) {
  constexpr uint32_t kUnused = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> target(mesh.positions.size(), kUnused);
  for (const glm::uvec3& t : mesh.triangles) target[t.x] = target[t.y] = target[t.z] = 0;
  uint32_t used = 0;
  for (uint32_t& v : target) {
    if (v != kUnused) v = used++;
  }
  if (used == target.size()) return;
  forEachAttribute(mesh, extras, [&](auto& array) {
    for (size_t v = 0; v < target.size(); ++v) {
      if (target[v] != kUnused) array[target[v]] = array[v];
    }
    array.resize(used);
    array.shrink_to_fit();
  });
  for (glm::uvec3& t : mesh.triangles) t = {target[t.x], target[t.y], target[t.z]};
}

void repairNormals(TriangleMesh& mesh, Report& report, const std::string& place) {
  uint64_t bad = 0;
  for (Vec3& n : mesh.normals) {
    n = normalizedOr(n, Vec3(0));
    bad += n == Vec3(0);
  }
  if (bad == 0) return;
  report.warn(place, "a normal is zero or not finite; the geometric normal is used", bad);
  std::vector<glm::dvec3> sums(mesh.normals.size(), glm::dvec3(0));
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::dvec3 n = areaNormal(mesh, t);
    for (const uint32_t v : {t.x, t.y, t.z}) sums[v] += n;
  }
  for (size_t v = 0; v < mesh.normals.size(); ++v) {
    if (mesh.normals[v] != Vec3(0)) continue;
    const glm::dvec3 n = unitOrZero(sums[v]);
    mesh.normals[v] = n == glm::dvec3(0) ? Vec3(0, 0, 1) : Vec3(n);
  }
}

bool repairTangents(TriangleMesh& mesh, Report& report, const std::string& place) {
  uint64_t bad = 0;
  for (size_t v = 0; v < mesh.tangents.size(); ++v) {
    Vec4& tangent = mesh.tangents[v];
    const Vec3 direction = normalizedOr(Vec3(tangent), Vec3(0));
    bad += direction == Vec3(0) || std::abs(glm::dot(direction, mesh.normals[v])) > 0.999f;
    tangent = Vec4(direction, tangent.w < 0 ? -1.0f : 1.0f);
  }
  if (bad > 0)
    report.warn(place, "a tangent is zero, not finite or along its normal; the primitive's tangents are computed", bad);
  return bad == 0;
}

void splitIntoFlatTriangles(TriangleMesh& mesh, ExtraAttributes& extras) {
  std::vector<uint32_t> source;
  source.reserve(mesh.triangles.size() * 3);
  for (const glm::uvec3& t : mesh.triangles) source.insert(source.end(), {t.x, t.y, t.z});
  forEachAttribute(mesh, extras, [&](auto& array) {
    std::remove_reference_t<decltype(array)> split(source.size());
    for (size_t v = 0; v < source.size(); ++v) split[v] = array[source[v]];
    array = std::move(split);
  });
  mesh.normals.resize(source.size());
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto first = static_cast<uint32_t>(3 * i);
    mesh.triangles[i] = {first, first + 1, first + 2};
    const glm::dvec3 n = unitOrZero(areaNormal(mesh, mesh.triangles[i]));
    for (uint32_t k = 0; k < 3; ++k) mesh.normals[first + k] = n == glm::dvec3(0) ? Vec3(0, 0, 1) : Vec3(n);
  }
}

}  // namespace braid::gltf
