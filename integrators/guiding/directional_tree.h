// SPDX-License-Identifier: Apache-2.0
// A density of directions: learned as a quadtree over the sphere (Müller, Gross and Novák 2017, section 3.1), squares
// of the map below that are cut where much of the power lies; read as a table.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "renderer/core/vec.h"

namespace braid {

// A direction's place in the unit square: its height along the z axis, and how far round it is, told by y / (|x| + |y|)
// in each quadrant, as that takes no trigonometry.
Vec2 squareOfDirection(const Vec3& w);
Vec3 directionOfSquare(const Vec2& p);
// Density per steradian of directions whose places are uniform, times 4π: between π/4 and π/2.
float squareStretch(const Vec3& w);

struct DirectionalNode {
  std::array<float, 4> share{0.25f, 0.25f, 0.25f, 0.25f};  // of the quarters in the node's probability; the sum is 1
  std::array<uint32_t, 4> child{};                         // 0: the quarter is flat
};

// What one sample tells of the density that is sought.
struct DirectionalPoint {
  Vec2 place;
  float power;  // not negative
};

// The tree whose density goes as the power a unit of area. The points are reordered. Children's indices are relative to
// the root. Without power: the uniform density.
std::vector<DirectionalNode> buildDirectionalTree(std::vector<DirectionalPoint>& points);

// A density of directions on a grid of the square: what a tree comes to, found with one look-up.
struct DirectionalTable {
  static constexpr int kSize = 16;

  explicit DirectionalTable(const std::vector<DirectionalNode>& tree);

  // Density at a place, relative to the uniform one.
  float density(const Vec2& p) const {
    const auto x = static_cast<size_t>(p.x * kSize), y = static_cast<size_t>(p.y * kSize);
    return cell[y][x];
  }
  // A place with that density from two variates in [0, 1); places that lie together come from variates that do.
  Vec2 sample(const Vec2& u, float& density) const;

  using Line = std::array<float, kSize>;
  std::array<Line, kSize> cell{};       // relative densities, row by row
  std::array<Line, kSize> endOfCell{};  // cumulative in their row, the last one 1
  Line endOfRow{};                      // cumulative, the last one 1
};

}  // namespace braid
