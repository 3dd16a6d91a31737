// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/round_shapes.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr float kFurthest = 1e17f;  // as of all vertices
constexpr size_t kShapesOfChunk = 256;

// About the origin; of a capsule, `end` tells which end of the segment a vertex belongs to.
struct Pattern {
  std::vector<glm::dvec3> vertices;  // of radius 1 before they are scaled
  std::vector<uint8_t> end;
  std::vector<glm::uvec3> triangles;  // counter-clockwise from outside
  double scale = 1;
};

Pattern octahedron() {
  Pattern p;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {1.0, -1.0}) p.vertices.push_back(glm::dvec3(axis == 0, axis == 1, axis == 2) * side);
  p.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  return p;
}

Pattern icosahedron() {
  const double g = 0.5 * (1 + std::sqrt(5.0));
  Pattern p;
  p.vertices = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  for (glm::dvec3& v : p.vertices) v = glm::normalize(v);
  p.triangles = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                 {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                 {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  return p;
}

// Each triangle into four, with the new vertices on the sphere.
void subdivide(Pattern& p) {
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
  const auto middle = [&](uint32_t a, uint32_t b) {
    const auto [entry, isNew] = middles.try_emplace(std::minmax(a, b), static_cast<uint32_t>(p.vertices.size()));
    if (isNew) p.vertices.push_back(glm::normalize(p.vertices[a] + p.vertices[b]));
    return entry->second;
  };
  std::vector<glm::uvec3> finer;
  for (const glm::uvec3& t : p.triangles) {
    const uint32_t a = middle(t.x, t.y), b = middle(t.y, t.z), c = middle(t.z, t.x);
    finer.insert(finer.end(), {{t.x, a, c}, {a, t.y, b}, {c, b, t.z}, {a, b, c}});
  }
  p.triangles = std::move(finer);
}

Pattern spherePattern(int level) {
  Pattern p = level == 3 ? octahedron() : icosahedron();
  for (int k = level; k < 2; ++k) subdivide(p);
  double area = 0;
  for (const glm::uvec3& t : p.triangles)
    area += 0.5 * glm::length(glm::cross(p.vertices[t.y] - p.vertices[t.x], p.vertices[t.z] - p.vertices[t.x]));
  p.scale = std::sqrt(4 * glm::pi<double>() / area);
  p.end.assign(p.vertices.size(), 0);
  return p;
}

struct CapsuleLevel {
  uint32_t sides, rings;  // around, and from the edge of a cap to its tip
};
constexpr CapsuleLevel kCapsules[kRoundLevels] = {{16, 4}, {10, 2}, {5, 1}, {3, 1}};

// Along z: rings of the lower cap from its tip up, then those of the upper one.
Pattern capsulePattern(int level) {
  const uint32_t sides = kCapsules[level].sides, rings = kCapsules[level].rings;
  Pattern p;
  const auto add = [&](const glm::dvec3& v, uint8_t end) {
    p.vertices.push_back(v);
    p.end.push_back(end);
  };
  add({0, 0, -1}, 0);
  for (uint32_t ring = 0; ring < 2 * rings; ++ring) {
    const bool upper = ring >= rings;
    const uint32_t fromEdge = upper ? ring - rings : rings - 1 - ring;
    const double latitude = 0.5 * glm::pi<double>() * fromEdge / rings;
    for (uint32_t k = 0; k < sides; ++k) {
      const double turn = 2 * glm::pi<double>() * k / sides;
      add({std::cos(latitude) * std::cos(turn), std::cos(latitude) * std::sin(turn),
           (upper ? 1 : -1) * std::sin(latitude)},
          upper);
    }
  }
  add({0, 0, 1}, 1);
  const auto at = [&](uint32_t ring, uint32_t k) { return 1 + ring * sides + k % sides; };
  const uint32_t tip = 2 * rings * sides + 1;
  for (uint32_t k = 0; k < sides; ++k) {
    p.triangles.push_back({0, at(0, k + 1), at(0, k)});
    for (uint32_t ring = 0; ring + 1 < 2 * rings; ++ring) {
      p.triangles.push_back({at(ring, k), at(ring, k + 1), at(ring + 1, k + 1)});
      p.triangles.push_back({at(ring, k), at(ring + 1, k + 1), at(ring + 1, k)});
    }
    p.triangles.push_back({at(2 * rings - 1, k), at(2 * rings - 1, k + 1), tip});
  }
  p.scale = glm::pi<double>() / (sides * std::sin(glm::pi<double>() / sides));
  return p;
}

// Axes of which the third runs along a segment. Every other one is turned, so that capsules in a row share no vertices,
// which would hide that each is closed.
glm::dmat3 axesAlong(const glm::dvec3& segment, bool isOdd, uint32_t sides) {
  const double length = glm::length(segment);
  const glm::dvec3 z = length > 0 ? segment / length : glm::dvec3(0, 0, 1);
  const glm::dvec3 a = glm::abs(z), aside(a.x <= a.y && a.x <= a.z, a.x > a.y && a.y <= a.z, a.x > a.z && a.y > a.z);
  const glm::dvec3 x = glm::normalize(glm::cross(aside == glm::dvec3(0) ? glm::dvec3(1, 0, 0) : aside, z));
  const glm::dvec3 y = glm::cross(z, x);
  const double turn = isOdd ? glm::pi<double>() / sides : 0;
  return {x * std::cos(turn) + y * std::sin(turn), y * std::cos(turn) - x * std::sin(turn), z};
}

class RoundBuilder {
 public:
  RoundBuilder(const TriangleMesh& spine, const Strokes& strokes, const RoundShape& shape)
      : spine_(spine), strokes_(strokes), shape_(shape), toLocal_(glm::inverse(shape.toWorld)) {}

  TriangleMesh build() {
    const bool isLines = !strokes_.segments.empty();
    const Pattern pattern = isLines ? capsulePattern(shape_.level) : spherePattern(shape_.level);
    const size_t count = isLines ? strokes_.segments.size() : strokes_.points.size();
    resize(count * pattern.vertices.size(), count * pattern.triangles.size());
    parallelChunks(count, kShapesOfChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const glm::uvec2 ends = isLines ? strokes_.segments[i] : glm::uvec2(strokes_.points[i]);
        place(pattern, i, ends, isLines ? axesOfSegment(ends, i) : glm::dmat3(1));
      }
    });
    return std::move(mesh_);
  }

 private:
  void resize(size_t vertices, size_t triangles) {
    // With room for padForEmbree(), which would copy them otherwise.
    mesh_.positions.reserve(vertices + 1);
    mesh_.triangles.reserve(triangles + 1);
    mesh_.positions.resize(vertices);
    mesh_.normals.resize(vertices);
    mesh_.triangles.resize(triangles);
    if (!spine_.colors.empty()) mesh_.colors.resize(vertices);
    for (size_t slot = 0; slot < kUvSlots; ++slot)
      if (!spine_.uv[slot].empty()) mesh_.uv[slot].resize(vertices);
  }

  glm::dmat3 axesOfSegment(const glm::uvec2& ends, size_t i) const {
    const glm::dvec3 local = glm::dvec3(spine_.positions[ends.y]) - glm::dvec3(spine_.positions[ends.x]);
    return axesAlong(shape_.toWorld * local, i % 2 == 1, kCapsules[shape_.level].sides);
  }

  void place(const Pattern& pattern, size_t i, const glm::uvec2& ends, const glm::dmat3& axes) {
    const size_t first = i * pattern.vertices.size();
    const double radius = static_cast<double>(shape_.radius) * pattern.scale;
    for (size_t k = 0; k < pattern.vertices.size(); ++k) {
      const uint32_t source = pattern.end[k] == 0 ? ends.x : ends.y;
      const glm::dvec3 outward = axes * pattern.vertices[k];
      mesh_.positions[first + k] = Vec3(glm::dvec3(spine_.positions[source]) + toLocal_ * (radius * outward));
      mesh_.normals[first + k] = Vec3(glm::normalize(glm::transpose(shape_.toWorld) * outward));
      if (!mesh_.colors.empty()) mesh_.colors[first + k] = spine_.colors[source];
      for (size_t slot = 0; slot < kUvSlots; ++slot)
        if (!mesh_.uv[slot].empty()) mesh_.uv[slot][first + k] = spine_.uv[slot][source];
    }
    const bool mirrored = glm::determinant(shape_.toWorld) < 0;
    for (size_t k = 0; k < pattern.triangles.size(); ++k) {
      glm::uvec3 t = pattern.triangles[k] + static_cast<uint32_t>(first);
      if (mirrored) std::swap(t.y, t.z);
      mesh_.triangles[i * pattern.triangles.size() + k] = t;
    }
  }

  const TriangleMesh& spine_;
  const Strokes& strokes_;
  const RoundShape& shape_;
  const glm::dmat3 toLocal_;
  TriangleMesh mesh_;
};

bool isPlace(const Vec3& p) {
  return std::abs(p.x) < kFurthest && std::abs(p.y) < kFurthest && std::abs(p.z) < kFurthest;
}

}  // namespace

uint64_t trianglesOfSphere(int level) { return level == 3 ? 8 : uint64_t(20) << (2 * (2 - level)); }

uint64_t trianglesOfCapsule(int level) { return uint64_t(4) * kCapsules[level].sides * kCapsules[level].rings; }

Strokes strokesOf(int mode, const std::vector<uint32_t>& indices, const std::vector<Vec3>& positions, uint64_t& lost) {
  Strokes strokes;
  const auto exists = [&](uint32_t v) { return v < positions.size() && isPlace(positions[v]); };
  if (mode == 0) {
    strokes.points = indices;
    std::sort(strokes.points.begin(), strokes.points.end());
    strokes.points.erase(std::unique(strokes.points.begin(), strokes.points.end()), strokes.points.end());
    lost += std::erase_if(strokes.points, [&](uint32_t v) { return !exists(v); });
    return strokes;
  }
  const size_t step = mode == 1 ? 2 : 1;
  for (size_t i = 0; i + 1 < indices.size(); i += step) strokes.segments.push_back({indices[i], indices[i + 1]});
  if (mode == 2 && indices.size() > 2) strokes.segments.push_back({indices.back(), indices.front()});
  lost += std::erase_if(strokes.segments, [&](const glm::uvec2& s) { return !exists(s.x) || !exists(s.y); });
  return strokes;
}

TriangleMesh roundMesh(const TriangleMesh& spine, const Strokes& strokes, const RoundShape& shape) {
  return RoundBuilder(spine, strokes, shape).build();
}

glm::dmat3 roundFrame(const glm::dmat3& linear) {
  const double scale = std::cbrt(std::abs(glm::determinant(linear)));
  const glm::dmat3 metric = glm::transpose(linear) * linear / (scale * scale);
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r)
      if (!(std::abs(metric[c][r] - (c == r ? 1 : 0)) < 1e-4)) return linear;
  // To 16 bits, so that rounding of rotations makes no difference.
  int exponent = 0;
  const double mantissa = std::round(std::frexp(scale, &exponent) * 65536) / 65536;
  return glm::dmat3(std::ldexp(mantissa, exponent));
}

}  // namespace braid
