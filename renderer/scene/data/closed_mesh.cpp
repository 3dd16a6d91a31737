// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/closed_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <utility>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr size_t kMostSolids = 4096;  // that are compared pair by pair

// One id per distinct position.
std::vector<uint32_t> weldPositions(const std::vector<Vec3>& positions) {
  std::vector<uint32_t> order(positions.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto less = [&](uint32_t a, uint32_t b) {
    const Vec3 &p = positions[a], &q = positions[b];
    return p.x != q.x ? p.x < q.x : p.y != q.y ? p.y < q.y : p.z < q.z;
  };
  std::sort(order.begin(), order.end(), less);
  std::vector<uint32_t> id(positions.size());
  for (size_t i = 0; i < order.size(); ++i)
    id[order[i]] =
        i > 0 && positions[order[i]] == positions[order[i - 1]] ? id[order[i - 1]] : static_cast<uint32_t>(i);
  return id;
}

// Of a placed mesh, around the corners of its own bounds; empty without vertices.
Bounds boundsOf(const TriangleMesh& mesh, const Mat4& toWorld) {
  Bounds local, world;
  for (const Vec3& p : mesh.positions) local.extend(p);
  for (int corner = 0; corner < 8 && !local.empty(); ++corner)
    world.extend(Vec3(toWorld * Vec4(corner & 1 ? local.hi.x : local.lo.x, corner & 2 ? local.hi.y : local.lo.y,
                                     corner & 4 ? local.hi.z : local.lo.z, 1)));
  return world;
}

bool isWithin(const Bounds& inner, const Bounds& outer) {
  return glm::all(glm::greaterThanEqual(inner.lo, outer.lo)) && glm::all(glm::lessThanEqual(inner.hi, outer.hi));
}

// The sum over triangles of how far normals look to the front.
double towardsFront(const TriangleMesh& mesh) {
  double sum = 0;
  for (const glm::uvec3& t : mesh.triangles) {
    const Vec3& a = mesh.positions[t.x];
    const glm::dvec3 front = glm::cross(glm::dvec3(mesh.positions[t.y] - a), glm::dvec3(mesh.positions[t.z] - a));
    sum +=
        glm::dot(front, glm::dvec3(mesh.normals[t.x]) + glm::dvec3(mesh.normals[t.y]) + glm::dvec3(mesh.normals[t.z]));
  }
  return sum;
}

void negateNormals(MeshVertices& vertices) {
  for (Vec3& n : vertices.normals) n = -n;
  for (std::vector<Vec4>* tangents : {&vertices.tangents, &vertices.otherTangents[0], &vertices.otherTangents[1]})
    for (Vec4& t : *tangents) t.w = -t.w;
}

}  // namespace

Facing facingOf(const TriangleMesh& mesh) {
  const std::vector<uint32_t> id = weldPositions(mesh.positions);
  std::vector<uint64_t> edges;
  edges.reserve(mesh.triangles.size() * 3);
  double volume = 0, area = 0, largest = 0;
  for (const glm::uvec3& t : mesh.triangles) {
    const uint32_t v[3] = {id[t.x], id[t.y], id[t.z]};
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    for (int k = 0; k < 3; ++k) edges.push_back(uint64_t(v[k]) << 32 | v[(k + 1) % 3]);
    const glm::dvec3 a(mesh.positions[t.x] - mesh.positions[0]), b(mesh.positions[t.y] - mesh.positions[0]),
        c(mesh.positions[t.z] - mesh.positions[0]);
    volume += glm::dot(a, glm::cross(b, c));
    area += glm::length(glm::cross(b - a, c - a));
  }
  for (const Vec3& p : mesh.positions) largest = std::max(largest, static_cast<double>(maxComponent(magnitudes(p))));
  std::sort(edges.begin(), edges.end());
  if (edges.empty() || std::adjacent_find(edges.begin(), edges.end()) != edges.end()) return Facing::Open;
  for (uint64_t e : edges)
    if (!std::binary_search(edges.begin(), edges.end(), e << 32 | e >> 32)) return Facing::Open;
  // Thinner than its coordinates are rounded, it is two faces back to back, of which rays may meet either.
  constexpr double kRounding = 2 * static_cast<double>(std::numeric_limits<float>::epsilon());
  if (!(std::fabs(volume) > kRounding * largest * area)) return Facing::Open;
  return volume > 0 ? Facing::Outward : Facing::Inward;
}

void turnInsideOut(TriangleMesh& mesh) {
  const bool turned = !mesh.normals.empty() && towardsFront(mesh) > 0;
  for (glm::uvec3& t : mesh.triangles) std::swap(t.y, t.z);
  if (!turned) return;
  negateNormals(mesh);
  for (MeshVertices& step : mesh.steps) negateNormals(step);
}

size_t turnSolidsOutward(SceneData& scene) {
  std::vector<uint8_t> turn(scene.meshes.size());
  parallelFor(turn.size(), [&](size_t m) {
    turn[m] = scene.materials[scene.meshes[m].material].hasVolume() && facingOf(scene.meshes[m]) == Facing::Inward;
  });
  if (std::find(turn.begin(), turn.end(), 1) == turn.end()) return 0;
  std::vector<std::pair<uint32_t, Bounds>> solids;
  for (const MeshInstance& i : scene.instances)
    if (scene.materials[scene.meshes[i.mesh].material].hasVolume())
      solids.emplace_back(i.mesh, boundsOf(scene.meshes[i.mesh], i.toWorld));
  if (solids.size() > kMostSolids) return 0;
  for (const auto& [inner, bounds] : solids) {
    if (!turn[inner]) continue;
    for (const auto& [outer, around] : solids)
      if (outer != inner && isWithin(bounds, around)) turn[inner] = 0;
  }
  size_t count = 0;
  for (size_t m = 0; m < turn.size(); ++m)
    if (turn[m]) turnInsideOut(scene.meshes[m]), ++count;
  return count;
}

}  // namespace braid
