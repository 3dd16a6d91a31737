// SPDX-License-Identifier: Apache-2.0
#include "integrators/guiding/directional_tree.h"

#include <algorithm>
#include <span>

namespace braid {

namespace {

// A square is cut while it holds this share of the power and so many points.
constexpr float kCutShare = 0.01f;
constexpr size_t kCutPoints = 24;
constexpr int kDeepest = 9;

int quarterOf(Vec2& p) {
  p *= 2.0f;
  const int x = p.x >= 1 ? 1 : 0, y = p.y >= 1 ? 1 : 0;
  p -= Vec2(static_cast<float>(x), static_cast<float>(y));
  return x + 2 * y;
}

class Builder {
 public:
  Builder(std::vector<DirectionalNode>& nodes, float total) : nodes_(nodes), threshold_(kCutShare * total) {}

  // Returns the square's part of the density, not normalised: its power. The places are relative to the
  // square. `link` is where its node's index goes, if it has one.
  float build(std::span<DirectionalPoint> points, float area, int depth, uint32_t* link) {
    float power = 0;
    for (const DirectionalPoint& p : points) power += p.power;
    const bool cut = depth == 0 || (power > threshold_ && points.size() >= kCutPoints && depth < kDeepest);
    if (!cut) return power;
    const auto index = static_cast<uint32_t>(nodes_.size());
    nodes_.emplace_back();
    if (link) *link = index;
    return buildQuarters(points, area, depth, index);
  }

 private:
  float buildQuarters(std::span<DirectionalPoint> points, float area, int depth, uint32_t index) {
    std::array<std::span<DirectionalPoint>, 4> quarter;
    const auto split = [](std::span<DirectionalPoint> all, int axis) {
      const auto middle =
          std::partition(all.begin(), all.end(), [axis](const DirectionalPoint& p) { return p.place[axis] < 0.5f; });
      return static_cast<size_t>(middle - all.begin());
    };
    const size_t rows = split(points, 1);
    for (int y = 0; y < 2; ++y) {
      const std::span<DirectionalPoint> row = y == 0 ? points.first(rows) : points.subspan(rows);
      const size_t columns = split(row, 0);
      quarter[static_cast<size_t>(2 * y)] = row.first(columns);
      quarter[static_cast<size_t>(2 * y + 1)] = row.subspan(columns);
    }
    std::array<float, 4> part;
    float sum = 0;
    for (size_t q = 0; q < 4; ++q) {
      for (DirectionalPoint& p : quarter[q]) quarterOf(p.place);
      uint32_t child = 0;
      part[q] = build(quarter[q], 0.25f * area, depth + 1, &child);
      nodes_[index].child[q] = child;
      sum += part[q];
    }
    for (size_t q = 0; q < 4; ++q) nodes_[index].share[q] = sum > 0 ? part[q] / sum : 0.25f;
    return sum;
  }

  std::vector<DirectionalNode>& nodes_;
  float threshold_;
};

}  // namespace

Vec2 squareOfDirection(const Vec3& w) {
  const float angle = std::atan2(w.y, w.x) * (0.5f * kInvPi);
  return glm::clamp(Vec2(0.5f * w.z + 0.5f, angle < 0 ? angle + 1 : angle), 0.0f, kOneMinusEpsilon);
}

Vec3 directionOfSquare(const Vec2& p) {
  const float z = 2 * p.x - 1, r = safeSqrt(1 - z * z), angle = 2 * kPi * p.y;
  return {r * std::cos(angle), r * std::sin(angle), z};
}

float DirectionalTrees::density(uint32_t root, Vec2 p) const {
  float density = 1;
  for (uint32_t index = root; index != 0;) {
    const DirectionalNode& node = nodes_[index];
    const auto q = static_cast<size_t>(quarterOf(p));
    density *= 4 * node.share[q];
    index = node.child[q];
  }
  return density;
}

Vec2 DirectionalTrees::sample(uint32_t root, Vec2 u, float& density) const {
  // Chooses a half by its share and stretches what is left of the variate.
  const auto choose = [](float lower, float& v) {
    const bool upper = v >= lower;
    v = upper ? (v - lower) / (1 - lower) : v / lower;
    v = std::min(v, kOneMinusEpsilon);
    return upper ? 1 : 0;
  };
  Vec2 corner(0);
  float size = 1;
  density = 1;
  for (uint32_t index = root; index != 0;) {
    const DirectionalNode& node = nodes_[index];
    const auto& s = node.share;
    const int x = choose(s[0] + s[2], u.x);
    const float lower = s[static_cast<size_t>(x)], upper = s[static_cast<size_t>(x + 2)];
    const int y = choose(lower / (lower + upper), u.y);
    const auto q = static_cast<size_t>(x + 2 * y);
    size *= 0.5f;
    corner += size * Vec2(static_cast<float>(x), static_cast<float>(y));
    density *= 4 * node.share[q];
    index = node.child[q];
  }
  return glm::min(corner + size * u, Vec2(kOneMinusEpsilon));
}

uint32_t DirectionalTrees::add(const std::vector<DirectionalNode>& tree) {
  const auto root = static_cast<uint32_t>(nodes_.size());
  for (DirectionalNode node : tree) {
    for (uint32_t& child : node.child)
      if (child != 0) child += root;
    nodes_.push_back(node);
  }
  return root;
}

std::vector<DirectionalNode> buildDirectionalTree(std::vector<DirectionalPoint>& points) {
  float total = 0;
  for (const DirectionalPoint& p : points) total += p.power;
  std::vector<DirectionalNode> nodes;
  Builder(nodes, total).build(points, 1, 0, nullptr);
  return nodes;
}

}  // namespace braid
