// SPDX-License-Identifier: Apache-2.0
// Light vertices of one pass that eye vertices merge with: a hash grid with cells of twice the merging radius, so that
// a query looks at eight of them. A vertex's own cell is compared, so that cells which share a bucket deliver nothing
// twice.
#pragma once

#include <vector>

#include "renderer/core/hash.h"
#include "renderer/transport/subpath.h"

namespace braid {

struct MergeVertex {
  Vec3 position;
  Vec3 wo;  // unit, back along the light subpath
  Spectrum throughput;
  float cosGeometric = 0;  // |cos| of wo with the geometric normal
  int segments = 0;
  MisQuantities mis;
};

class MergeGrid {
 public:
  MergeGrid(std::vector<MergeVertex> vertices, float radius);

  float radius() const { return radius_; }
  size_t size() const { return vertices_.size(); }

  // Calls visit(vertex) for every vertex within the radius of p.
  template <class Visit>
  void query(const Vec3& p, const Visit& visit) const {
    if (vertices_.empty()) return;
    const glm::ivec3 lo = cellOf(p - radius_), hi = cellOf(p + radius_);
    for (int z = lo.z; z <= hi.z; ++z)
      for (int y = lo.y; y <= hi.y; ++y)
        for (int x = lo.x; x <= hi.x; ++x) {
          const glm::ivec3 cell(x, y, z);
          const uint32_t bucket = bucketOf(cell);
          for (uint32_t i = start_[bucket]; i < start_[bucket + 1]; ++i) {
            const MergeVertex& v = vertices_[i];
            const Vec3 d = v.position - p;
            if (glm::dot(d, d) <= radius_ * radius_ && cellOf(v.position) == cell) visit(v);
          }
        }
  }

 private:
  glm::ivec3 cellOf(const Vec3& p) const {
    const Vec3 c = glm::floor(glm::clamp(p * inverseCell_, Vec3(-1e9f), Vec3(1e9f)));
    return glm::ivec3(c);
  }
  uint32_t bucketOf(const glm::ivec3& c) const {
    return mix32(static_cast<uint32_t>(c.x) * 0x9e3779b1u ^ static_cast<uint32_t>(c.y) * 0x85ebca77u ^
                 static_cast<uint32_t>(c.z) * 0xc2b2ae3du) &
           mask_;
  }

  float radius_, inverseCell_;
  uint32_t mask_ = 0;
  std::vector<uint32_t> start_;  // of each bucket, and the end of the last
  std::vector<MergeVertex> vertices_;
};

}  // namespace braid
