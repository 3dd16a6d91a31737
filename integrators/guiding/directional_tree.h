// SPDX-License-Identifier: Apache-2.0
// A density of directions as a quadtree over the sphere (Müller, Gross and Novák 2017, section 3.1): squares of the map
// below, cut where much of the density lies.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "renderer/core/vec.h"

namespace braid {

// A direction's place in the unit square by an equal-area map about the z axis: (height, angle).
Vec2 squareOfDirection(const Vec3& w);
Vec3 directionOfSquare(const Vec2& p);

struct DirectionalNode {
  std::array<float, 4> share{0.25f, 0.25f, 0.25f, 0.25f};  // of the quarters in the node's probability; the sum is 1
  std::array<uint32_t, 4> child{};                         // 0: the quarter is flat
};

// The trees of all regions, one after the other; a tree is known by the index of its root, which is not 0.
class DirectionalTrees {
 public:
  DirectionalTrees() : nodes_(1) {}

  // Density at a place, relative to the uniform one.
  float density(uint32_t root, Vec2 p) const;
  // A place with that density from two variates in [0, 1); places that lie together come from variates that do.
  Vec2 sample(uint32_t root, Vec2 u, float& density) const;

  // Appends a tree of its own, whose root is the first node, and returns the index of its root here.
  uint32_t add(const std::vector<DirectionalNode>& tree);
  size_t size() const { return nodes_.size(); }
  size_t bytes() const { return nodes_.size() * sizeof(DirectionalNode); }

 private:
  std::vector<DirectionalNode> nodes_;  // the first one stands for none
};

// What one sample tells of the density that is sought.
struct DirectionalPoint {
  Vec2 place;
  float power;  // not negative
};

// The tree whose density goes as the power a unit of area. The points are reordered. Children's indices are relative to
// the root. Without power: the uniform density.
std::vector<DirectionalNode> buildDirectionalTree(std::vector<DirectionalPoint>& points);

}  // namespace braid
