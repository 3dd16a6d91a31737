// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/lights/light_tree.h"

#include <algorithm>
#include <array>
#include <limits>
#include <span>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

// Union of two cones (Pharr et al. 2023, section 3.8.4), angles in radians.
void unionCones(Vec3& axis, float& cosAngle, const Vec3& otherAxis, float otherCos) {
  const float a = std::acos(std::clamp(cosAngle, -1.0f, 1.0f)), b = std::acos(std::clamp(otherCos, -1.0f, 1.0f));
  const float between = std::acos(std::clamp(glm::dot(axis, otherAxis), -1.0f, 1.0f));
  if (std::min(between + b, kPi) <= a) return;
  if (std::min(between + a, kPi) <= b) {
    axis = otherAxis;
    cosAngle = otherCos;
    return;
  }
  const float half = 0.5f * (a + b + between);
  const Vec3 normal = glm::cross(axis, otherAxis);
  const float length2 = glm::dot(normal, normal);
  if (half >= kPi || length2 < 1e-12f) {
    cosAngle = -1;
    return;
  }
  const float turn = half - a;
  const Vec3 k = normal / std::sqrt(length2);
  axis = glm::normalize(axis * std::cos(turn) + glm::cross(k, axis) * std::sin(turn));
  cosAngle = std::cos(half);
}

LightBounds merge(const LightBounds& a, const LightBounds& b) {
  if (a.power == 0 && a.bounds.empty()) return b;
  if (b.power == 0 && b.bounds.empty()) return a;
  LightBounds m = a;
  m.bounds.extend(b.bounds);
  m.power = a.power + b.power;
  m.range = std::max(a.range, b.range);
  m.twoSided = a.twoSided || b.twoSided;
  m.cosEmission = std::min(a.cosEmission, b.cosEmission);
  unionCones(m.axis, m.cosNormals, b.axis, b.cosNormals);
  return m;
}

// Surface area orientation heuristic (Conty Estevez and Kulla 2018, Eq. 1).
float splitCost(const LightBounds& b, const Vec3& parentDiagonal, int dimension) {
  const float normals = std::acos(std::clamp(b.cosNormals, -1.0f, 1.0f)),
              emission = std::acos(std::clamp(b.cosEmission, -1.0f, 1.0f));
  const float w = std::min(normals + emission, kPi);
  const float sinNormals = std::sin(normals);
  const float orientation =
      2 * kPi * (1 - b.cosNormals) +
      0.5f * kPi * (2 * w * sinNormals - std::cos(normals - 2 * w) - 2 * normals * sinNormals + b.cosNormals);
  const float longest = maxComponent(parentDiagonal);
  const float regular = longest / std::max(parentDiagonal[dimension], longest * 1e-6f);
  const Vec3 d = b.bounds.diagonal();
  const float area = 2 * (d.x * d.y + d.y * d.z + d.z * d.x);
  return b.power * orientation * regular * area;
}

// Looks for the cheapest split of some lights into two, along the axes and between buckets of their centres.
class SplitSearch {
 public:
  SplitSearch(const std::vector<LightBounds>& lights, std::span<const uint32_t> chosen)
      : lights_(lights), chosen_(chosen) {
    Bounds bounds;
    for (const uint32_t light : chosen_) {
      centres_.extend(lights_[light].bounds.centre());
      bounds.extend(lights_[light].bounds);
    }
    extent_ = centres_.diagonal();
    diagonal_ = bounds.diagonal();
    for (int d = 0; d < 3; ++d)
      if (extent_[d] > 0) tryDimension(d);
  }
  bool found() const { return dimension_ >= 0; }
  bool below(uint32_t light) const { return bucketOf(light, dimension_) <= bucket_; }

 private:
  static constexpr int kBuckets = 12;

  int bucketOf(uint32_t light, int dimension) const {
    const float f = (lights_[light].bounds.centre()[dimension] - centres_.lo[dimension]) / extent_[dimension];
    return std::clamp(static_cast<int>(f * kBuckets), 0, kBuckets - 1);
  }

  void tryDimension(int dimension) {
    std::array<LightBounds, kBuckets> bucket, above;
    for (const uint32_t light : chosen_) {
      LightBounds& b = bucket[static_cast<size_t>(bucketOf(light, dimension))];
      b = merge(b, lights_[light]);
    }
    above[kBuckets - 1] = bucket[kBuckets - 1];
    for (size_t i = kBuckets - 1; i-- > 1;) above[i] = merge(bucket[i], above[i + 1]);
    LightBounds below;
    for (size_t i = 0; i + 1 < kBuckets; ++i) {
      below = merge(below, bucket[i]);
      if (below.bounds.empty() || above[i + 1].bounds.empty()) continue;
      const float cost = splitCost(below, diagonal_, dimension) + splitCost(above[i + 1], diagonal_, dimension);
      if (!(cost < best_)) continue;
      best_ = cost;
      dimension_ = dimension;
      bucket_ = static_cast<int>(i);
    }
  }

  const std::vector<LightBounds>& lights_;
  std::span<const uint32_t> chosen_;
  Bounds centres_;
  Vec3 extent_, diagonal_;
  float best_ = kInfinity;
  int dimension_ = -1, bucket_ = 0;
};

// Sorts the lights of a node into its two children; the number of the left one's.
size_t splitLights(const std::vector<LightBounds>& lights, std::span<uint32_t> order, int depth) {
  // Deeper than any useful hierarchy: halves, so that the recursion ends.
  constexpr int kMostDepth = 48;
  size_t left = 0;
  if (depth < kMostDepth) {
    const SplitSearch search(lights, order);
    if (search.found()) {
      const auto split =
          std::partition(order.begin(), order.end(), [&](uint32_t light) { return search.below(light); });
      left = static_cast<size_t>(split - order.begin());
    }
  }
  return left == 0 || left == order.size() ? order.size() / 2 : left;
}

}  // namespace

void LightTree::build(const std::vector<LightBounds>& lights) {
  groups_.clear();
  root_ = kLeaf;
  position_.assign(lights.size(), ~0u);
  std::vector<uint32_t> order;
  for (uint32_t i = 0; i < lights.size(); ++i)
    if (lights[i].power > 0) order.push_back(i);
  if (order.empty()) return;
  Nodes nodes(2 * order.size() - 1);
  buildNode(lights, order, nodes, 0, 0);
  for (uint32_t i = 0; i < order.size(); ++i) position_[order[i]] = i;
  root_ = nodes[0].leftLeaves == 0 ? kLeaf | nodes[0].light : addGroup(nodes, 0, 0);
  groups_.shrink_to_fit();
}

void LightTree::buildNode(const std::vector<LightBounds>& lights, std::span<uint32_t> order, Nodes& nodes, size_t node,
                          int depth) {
  if (order.size() == 1) {
    nodes[node] = {lights[order[0]], 0, order[0]};
    return;
  }
  const size_t left = splitLights(lights, order, depth);
  const auto buildLeft = [&] { buildNode(lights, order.first(left), nodes, node + 1, depth + 1); };
  const auto buildRight = [&] { buildNode(lights, order.subspan(left), nodes, node + 2 * left, depth + 1); };
  if (order.size() > 4096) {
    parallelBoth(buildLeft, buildRight);
  } else {
    buildLeft();
    buildRight();
  }
  nodes[node] = {merge(nodes[node + 1].bounds, nodes[node + 2 * left].bounds), static_cast<uint32_t>(left), ~0u};
}

void LightTree::setLane(Group& group, size_t lane, const Node& node) {
  const LightBounds& b = node.bounds;
  const Vec3 centre = b.bounds.centre();
  group.centreX[lane] = centre.x;
  group.centreY[lane] = centre.y;
  group.centreZ[lane] = centre.z;
  group.radius[lane] = 0.5f * glm::length(b.bounds.diagonal());
  group.axisX[lane] = b.axis.x;
  group.axisY[lane] = b.axis.y;
  group.axisZ[lane] = b.axis.z;
  group.power[lane] = b.power;
  const float radius2 = sqr(group.radius[lane]);
  group.inside[lane] = radius2 > 0 ? b.power / radius2 : b.power;
  group.inverseRange[lane] = 1 / std::max(b.range, std::numeric_limits<float>::min());
  group.cosNormals[lane] = b.cosNormals;
  group.sinNormals[lane] = safeSqrt(1 - sqr(b.cosNormals));
  group.cosEmission[lane] = b.cosEmission;
  group.twoSided[lane] = b.twoSided ? 1 : 0;
}

uint32_t LightTree::addGroup(const Nodes& nodes, size_t node, uint32_t firstLeaf) {
  const auto index = static_cast<uint32_t>(groups_.size());
  groups_.push_back({});
  const size_t children[2] = {node + 1, node + 2 * nodes[node].leftLeaves};
  const uint32_t leaves[2] = {firstLeaf, firstLeaf + nodes[node].leftLeaves};
  groups_[index].rightLeaves[0] = leaves[1];
  for (size_t c = 0; c < 2; ++c) {
    const Node& child = nodes[children[c]];
    setLane(groups_[index], c, child);
    groups_[index].rightLeaves[1 + c] = child.leftLeaves == 0 ? ~0u : leaves[c] + child.leftLeaves;
    if (child.leftLeaves == 0) {
      setLane(groups_[index], 2 + 2 * c, child);
      groups_[index].next[2 * c] = groups_[index].next[2 * c + 1] = kLeaf | child.light;
      continue;
    }
    for (size_t g = 0; g < 2; ++g) {
      const size_t grandchild = g == 0 ? children[c] + 1 : children[c] + 2 * child.leftLeaves;
      const Node& below = nodes[grandchild];
      setLane(groups_[index], 2 + 2 * c + g, below);
      const uint32_t next = below.leftLeaves == 0
                                ? kLeaf | below.light
                                : addGroup(nodes, grandchild, g == 0 ? leaves[c] : leaves[c] + child.leftLeaves);
      groups_[index].next[2 * c + g] = next;
    }
  }
  return index;
}

}  // namespace braid
