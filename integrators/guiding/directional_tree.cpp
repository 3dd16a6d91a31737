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

  // Returns the square's power. The places are relative to the square. `link` is where its node's index goes, if any.
  float build(std::span<DirectionalPoint> points, int depth, uint32_t* link) {
    float power = 0;
    for (const DirectionalPoint& p : points) power += p.power;
    const bool cut = depth == 0 || (power > threshold_ && points.size() >= kCutPoints && depth < kDeepest);
    if (!cut) return power;
    const auto index = static_cast<uint32_t>(nodes_.size());
    nodes_.emplace_back();
    if (link) *link = index;
    return buildQuarters(points, depth, index);
  }

 private:
  float buildQuarters(std::span<DirectionalPoint> points, int depth, uint32_t index) {
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
      part[q] = build(quarter[q], depth + 1, &child);
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
  const float x = std::fabs(w.x), y = std::fabs(w.y), sum = x + y;
  float round = sum > 0 ? y / sum : 0.0f;  // in quadrants, from the x axis
  if (w.x < 0) round = 2 - round;
  if (w.y < 0) round = 4 - round;
  return glm::clamp(Vec2(0.5f * w.z + 0.5f, 0.25f * round), 0.0f, kOneMinusEpsilon);
}

Vec3 directionOfSquare(const Vec2& p) {
  float round = 4 * p.y;
  const float signY = round > 2 ? -1.0f : 1.0f;
  if (round > 2) round = 4 - round;
  const float signX = round > 1 ? -1.0f : 1.0f;
  if (round > 1) round = 2 - round;
  const float z = 2 * p.x - 1, x = 1 - round, r = std::sqrt(std::max(1 - z * z, 0.0f) / (x * x + round * round));
  return {signX * x * r, signY * round * r, z};
}

float squareStretch(const Vec3& w) {
  const float flat = w.x * w.x + w.y * w.y, sum = std::fabs(w.x) + std::fabs(w.y);
  return sum > 0 ? 0.5f * kPi * (flat / (sum * sum)) : 0.5f * kPi;
}

std::vector<DirectionalNode> buildDirectionalTree(std::vector<DirectionalPoint>& points) {
  float total = 0;
  for (const DirectionalPoint& p : points) total += p.power;
  std::vector<DirectionalNode> nodes;
  Builder(nodes, total).build(points, 0, nullptr);
  return nodes;
}

namespace {

// Spreads the probability of a square of `size` cells over them.
void spread(const std::vector<DirectionalNode>& tree, uint32_t index, float probability, std::array<int, 3> square,
            DirectionalTable& table) {
  const auto [left, top, size] = square;
  const int half = size / 2;
  for (size_t q = 0; half > 0 && q < 4; ++q) {
    const float part = probability * tree[index].share[q];
    const std::array<int, 3> quarter{left + static_cast<int>(q % 2) * half, top + static_cast<int>(q / 2) * half, half};
    if (tree[index].child[q] != 0 && half > 1) {
      spread(tree, tree[index].child[q], part, quarter, table);
      continue;
    }
    constexpr float kCells = DirectionalTable::kSize * DirectionalTable::kSize;
    const float density = part * kCells / static_cast<float>(half * half);
    for (int y = quarter[1]; y < quarter[1] + half; ++y)
      for (int x = quarter[0]; x < quarter[0] + half; ++x)
        table.cell[static_cast<size_t>(y)][static_cast<size_t>(x)] = density;
  }
}

// Fills in the cumulative shares of the weights; uniform ones where all are 0.
float accumulate(const DirectionalTable::Line& weight, DirectionalTable::Line& end) {
  float sum = 0;
  for (size_t i = 0; i < weight.size(); ++i) end[i] = sum += weight[i];
  for (size_t i = 0; i < weight.size(); ++i)
    end[i] = sum > 0 ? end[i] / sum : static_cast<float>(i + 1) / static_cast<float>(weight.size());
  end.back() = 1;
  return sum;
}

// The interval that a variate falls into, which is stretched to [0, 1).
size_t pickInterval(const DirectionalTable::Line& end, float& u) {
  size_t i = 0;
  for (size_t k = 0; k + 1 < end.size(); ++k) i += u >= end[k] ? 1u : 0u;
  const float begin = i > 0 ? end[i - 1] : 0.0f;
  u = std::clamp((u - begin) / (end[i] - begin), 0.0f, kOneMinusEpsilon);
  return i;
}

}  // namespace

DirectionalTable::DirectionalTable(const std::vector<DirectionalNode>& tree) {
  spread(tree, 0, 1, {0, 0, kSize}, *this);
  Line rows;
  for (size_t y = 0; y < rows.size(); ++y) rows[y] = accumulate(cell[y], endOfCell[y]);
  accumulate(rows, endOfRow);
}

Vec2 DirectionalTable::sample(const Vec2& u, float& density) const {
  Vec2 within = u;
  const size_t y = pickInterval(endOfRow, within.y), x = pickInterval(endOfCell[y], within.x);
  density = cell[y][x];
  const Vec2 corner(static_cast<float>(x), static_cast<float>(y));
  return glm::min((corner + within) / static_cast<float>(kSize), Vec2(kOneMinusEpsilon));
}

}  // namespace braid
