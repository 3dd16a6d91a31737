// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/tangents.h"

#include <array>
#include <cmath>
#include <cstring>
#include <unordered_map>

#include "renderer/core/hash.h"

namespace braid {

namespace {

// Bit patterns, so that only truly equal vertices share a tangent.
using VertexKey = std::array<uint32_t, 8>;

struct VertexKeyHash {
  size_t operator()(const VertexKey& key) const {
    uint64_t h = 0;
    for (size_t i = 0; i < key.size(); i += 2) h = hashCombine(h, uint64_t(key[i]) << 32 | key[i + 1]);
    return h;
  }
};

VertexKey keyOf(const TriangleMesh& mesh, const std::vector<Vec2>& uv, size_t v) {
  VertexKey key;
  std::memcpy(&key[0], &mesh.positions[v], sizeof(Vec3));
  std::memcpy(&key[3], &mesh.normals[v], sizeof(Vec3));
  std::memcpy(&key[6], &uv[v], sizeof(Vec2));
  return key;
}

// For each vertex the first one with the same position, normal and texture coordinates.
std::vector<uint32_t> welded(const TriangleMesh& mesh, const std::vector<Vec2>& uv) {
  std::unordered_map<VertexKey, uint32_t, VertexKeyHash> first;
  first.reserve(mesh.positions.size());
  std::vector<uint32_t> result(mesh.positions.size());
  for (size_t v = 0; v < result.size(); ++v) {
    result[v] = first.emplace(keyOf(mesh, uv, v), static_cast<uint32_t>(v)).first->second;
  }
  return result;
}

// How a triangle lays the texture over its plane.
struct TextureSpace {
  glm::dvec3 tangent{0};  // direction of growing u
  double area = 0;        // signed, in texture space; 0: no direction can be told
};

TextureSpace textureSpace(const TriangleMesh& mesh, const std::vector<Vec2>& uv, const glm::uvec3& t) {
  const glm::dvec3 d1 = glm::dvec3(mesh.positions[t.y]) - glm::dvec3(mesh.positions[t.x]);
  const glm::dvec3 d2 = glm::dvec3(mesh.positions[t.z]) - glm::dvec3(mesh.positions[t.x]);
  const glm::dvec2 e1 = glm::dvec2(uv[t.y]) - glm::dvec2(uv[t.x]), e2 = glm::dvec2(uv[t.z]) - glm::dvec2(uv[t.x]);
  TextureSpace space;
  const double area = e1.x * e2.y - e2.x * e1.y;
  const glm::dvec3 direction = (d1 * e2.y - d2 * e1.y) * (area < 0 ? -1.0 : 1.0);
  const double length = glm::length(direction);
  if (area == 0 || !(length > 0) || !std::isfinite(length)) return space;
  space.tangent = direction / length;
  space.area = area;
  return space;
}

glm::dvec3 inPlane(const glm::dvec3& v, const glm::dvec3& normal) {
  const glm::dvec3 p = v - normal * glm::dot(normal, v);
  const double length = glm::length(p);
  return length > 0 ? p / length : glm::dvec3(0);
}

// The sums over triangles around a vertex, apart for mirrored [1] and unmirrored [0] texture space.
using Sums = std::array<glm::dvec3, 2>;

void addTriangle(const TriangleMesh& mesh, const glm::uvec3& t, const TextureSpace& space,
                 const std::vector<uint32_t>& weld, std::vector<Sums>& sums) {
  for (int corner = 0; corner < 3; ++corner) {
    const uint32_t v = t[corner], next = t[(corner + 1) % 3], previous = t[(corner + 2) % 3];
    const glm::dvec3 p(mesh.positions[v]), n(mesh.normals[v]);
    const glm::dvec3 a = inPlane(glm::dvec3(mesh.positions[next]) - p, n),
                     b = inPlane(glm::dvec3(mesh.positions[previous]) - p, n);
    const double angle = std::acos(glm::clamp(glm::dot(a, b), -1.0, 1.0));
    sums[weld[v]][space.area > 0 ? 1 : 0] += angle * inPlane(space.tangent, n);
  }
}

Vec4 finished(const glm::dvec3& sum, const Vec3& normal, bool mirrored) {
  const glm::dvec3 direction = inPlane(sum, glm::dvec3(normal));
  const Vec3 tangent = direction == glm::dvec3(0) ? Frame(normal).s : Vec3(direction);
  return Vec4(tangent, mirrored ? -1.0f : 1.0f);
}

uint32_t duplicate(TriangleMesh& mesh, std::vector<std::vector<Vec2>>& uvs, uint32_t v) {
  const auto copy = static_cast<uint32_t>(mesh.positions.size());
  const auto append = [v](auto& array) {
    if (!array.empty()) {
      const auto value = array[v];
      array.push_back(value);
    }
  };
  append(mesh.positions);
  append(mesh.normals);
  append(mesh.tangents);
  append(mesh.otherTangents[0]);
  append(mesh.otherTangents[1]);
  for (std::vector<Vec2>& uv : mesh.uv) append(uv);
  append(mesh.colors);
  for (std::vector<Vec2>& uv : uvs) append(uv);
  return copy;
}

}  // namespace

void generateTangents(TriangleMesh& mesh, size_t frame, std::vector<std::vector<Vec2>>& uvs) {
  const std::vector<Vec2>& uv = uvs[frame];
  std::vector<Vec4>& tangents = frame == 0 ? mesh.tangents : mesh.otherTangents[frame - 1];
  const std::vector<uint32_t> weld = welded(mesh, uv);
  std::vector<TextureSpace> spaces(mesh.triangles.size());
  std::vector<Sums> sums(mesh.positions.size(), Sums{glm::dvec3(0), glm::dvec3(0)});
  for (size_t i = 0; i < spaces.size(); ++i) {
    spaces[i] = textureSpace(mesh, uv, mesh.triangles[i]);
    if (spaces[i].area != 0) addTriangle(mesh, mesh.triangles[i], spaces[i], weld, sums);
  }
  // v points down in glTF, so texture space that looks mirrored by its signed area is not, and the other way round.
  constexpr uint32_t kNobody = 0xffffffffu;
  const size_t originals = mesh.positions.size();
  std::vector<std::array<uint32_t, 2>> copies(originals, {kNobody, kNobody});
  tangents.assign(originals, Vec4(0));
  for (size_t i = 0; i < spaces.size(); ++i) {
    if (spaces[i].area == 0) continue;
    const size_t side = spaces[i].area > 0 ? 1 : 0;
    for (int corner = 0; corner < 3; ++corner) {
      uint32_t& index = mesh.triangles[i][corner];
      const uint32_t original = index;
      uint32_t& copy = copies[original][side];
      if (copy == kNobody) {
        const bool isFirst = copies[original][1 - side] == kNobody;
        copy = isFirst ? original : duplicate(mesh, uvs, original);
        tangents[copy] = finished(sums[weld[original]][side], mesh.normals[original], side == 1);
      }
      index = copy;
    }
  }
  // Vertices that only triangles without texture space use: any frame will do.
  for (size_t v = 0; v < originals; ++v) {
    if (copies[v][0] == kNobody && copies[v][1] == kNobody)
      tangents[v] = finished(glm::dvec3(0), mesh.normals[v], false);
  }
}

}  // namespace braid
