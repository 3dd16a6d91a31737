// SPDX-License-Identifier: Apache-2.0
// A hierarchy over finite lights that picks one in logarithmic time, by an upper bound of what each node can send to
// the shading point.
//
// Conty Estevez and Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting" (2018), with the
// importance of Pharr et al. 2023, section 12.6.3; the clamp of the distance uses the squared node radius, so that the
// choice does not depend on the unit of length.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "renderer/core/vec.h"

namespace braid {

// Where a light is and where it shines.
struct LightBounds {
  Bounds bounds;
  Vec3 axis{0, 0, 1};
  float cosNormals = 1;     // cosine of the half angle of the cone of its normals about the axis
  float cosEmission = 0;    // cosine of the angle beyond the normals within which it emits
  float power = 0;          // W, channel average
  float range = kInfinity;  // metres, as rangeWindow()
  bool twoSided = false;
};

class LightTree {
 public:
  void build(const std::vector<LightBounds>& lights);
  bool empty() const { return nodes_.empty(); }

  // Picks a light for the point p with normal n (zero: no receiver cosine; `twoSided`: both sides of n receive). u is
  // rescaled to a fresh variate. Returns the light and its probability; probability 0: nothing can contribute.
  uint32_t sample(const Vec3& p, const Vec3& n, bool twoSided, float& u, float& probability) const;
  float probability(const Vec3& p, const Vec3& n, bool twoSided, uint32_t light) const;

  size_t bytes() const { return nodes_.size() * sizeof(Node) + position_.size() * sizeof(uint32_t); }

 private:
  struct Node {
    Vec3 centre;
    float radius;
    Vec3 axis;
    float power;
    float range;
    float cosNormals, cosEmission;
    uint32_t leftLeaves;  // leaves of the left child (which follows the node); 0: a leaf
    uint32_t light;       // of a leaf
    bool twoSided;
  };
  float importance(const Node& node, const Vec3& p, const Vec3& n, bool twoSided) const;
  // Builds the node of some lights and those below it; sorts `order` into the order of the leaves.
  LightBounds buildNode(const std::vector<LightBounds>& lights, std::span<uint32_t> order, size_t node, int depth);

  std::vector<Node> nodes_;         // depth first: left child at +1, right child at +2·leftLeaves
  std::vector<uint32_t> position_;  // of each light among the leaves
};

}  // namespace braid
