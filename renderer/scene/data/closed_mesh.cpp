// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/closed_mesh.h"

#include <algorithm>
#include <cstring>
#include <numeric>

namespace braid {

namespace {

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

}  // namespace

bool isClosedOutward(const TriangleMesh& mesh) {
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
  if (edges.empty() || std::adjacent_find(edges.begin(), edges.end()) != edges.end()) return false;
  for (uint64_t e : edges)
    if (!std::binary_search(edges.begin(), edges.end(), e << 32 | e >> 32)) return false;
  // Thinner than its coordinates are rounded, it is two faces back to back, of which rays may meet either.
  constexpr double kRounding = 2 * static_cast<double>(std::numeric_limits<float>::epsilon());
  return volume > kRounding * largest * area;
}

}  // namespace braid
