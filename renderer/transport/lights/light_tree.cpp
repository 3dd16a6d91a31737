// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/lights/light_tree.h"

#include <algorithm>
#include <array>
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

// The share of the left one of two nodes. A node that may contribute keeps a chance worth a float's digits: the other,
// however bright, may be hidden.
float leftProbability(float left, float right) {
  constexpr float kLeast = 0x1p-10f;
  const float p = left / (left + right);
  return left > 0 && right > 0 ? std::clamp(p, kLeast, 1 - kLeast) : p;
}

}  // namespace

void LightTree::build(const std::vector<LightBounds>& lights) {
  nodes_.clear();
  position_.assign(lights.size(), ~0u);
  std::vector<uint32_t> order;
  for (uint32_t i = 0; i < lights.size(); ++i)
    if (lights[i].power > 0) order.push_back(i);
  if (order.empty()) return;
  nodes_.resize(2 * order.size() - 1);
  buildNode(lights, order, 0, 0);
  for (uint32_t i = 0; i < order.size(); ++i) position_[order[i]] = i;
}

LightBounds LightTree::buildNode(const std::vector<LightBounds>& lights, std::span<uint32_t> order, size_t node,
                                 int depth) {
  LightBounds total;
  size_t left = 0;
  if (order.size() == 1) {
    total = lights[order[0]];
  } else {
    left = splitLights(lights, order, depth);
    LightBounds l, r;
    const auto buildLeft = [&] { l = buildNode(lights, order.first(left), node + 1, depth + 1); };
    const auto buildRight = [&] { r = buildNode(lights, order.subspan(left), node + 2 * left, depth + 1); };
    if (order.size() > 4096) {
      parallelBoth(buildLeft, buildRight);
    } else {
      buildLeft();
      buildRight();
    }
    total = merge(l, r);
  }
  Node& n = nodes_[node];
  n.centre = total.bounds.centre();
  n.radius = 0.5f * glm::length(total.bounds.diagonal());
  n.axis = total.axis;
  n.power = total.power;
  n.range = total.range;
  n.cosNormals = total.cosNormals;
  n.cosEmission = total.cosEmission;
  n.twoSided = total.twoSided;
  n.leftLeaves = static_cast<uint32_t>(left);
  n.light = left == 0 ? order[0] : ~0u;
  return total;
}

float LightTree::importance(const Node& node, const Vec3& p, const Vec3& n, bool twoSided) const {
  const Vec3 d = p - node.centre;
  const float distance2 = glm::dot(d, d), radius2 = sqr(node.radius);
  const float clamped2 = std::max(distance2, radius2);
  if (!(clamped2 > 0)) return node.power;
  if (distance2 <= radius2) return node.power / clamped2;  // inside the sphere nothing is known of directions

  const float inverseDistance = 1 / std::sqrt(distance2);
  const Vec3 w = d * inverseDistance;
  const float sin2Bound = radius2 / distance2;
  const float sinBound = std::sqrt(sin2Bound), cosBound = safeSqrt(1 - sin2Bound);
  // cos(max(0, a - b)) for angles given by cosine and sine.
  const auto cosMinus = [](float sinA, float cosA, float sinB, float cosB) {
    return cosA > cosB ? 1.0f : cosA * cosB + sinA * sinB;
  };
  const auto sinMinus = [](float sinA, float cosA, float sinB, float cosB) {
    return cosA > cosB ? 0.0f : sinA * cosB - cosA * sinB;
  };

  float cosAxis = glm::dot(node.axis, w);
  if (node.twoSided) cosAxis = std::abs(cosAxis);
  const float sinAxis = safeSqrt(1 - sqr(cosAxis)), sinNormals = safeSqrt(1 - sqr(node.cosNormals));
  const float cosX = cosMinus(sinAxis, cosAxis, sinNormals, node.cosNormals),
              sinX = sinMinus(sinAxis, cosAxis, sinNormals, node.cosNormals);
  const float cosEmit = cosMinus(sinX, cosX, sinBound, cosBound);
  if (cosEmit <= node.cosEmission) return 0;
  // Slack on both cosines: rounding must not turn a light that contributes a little into one that is never chosen.
  float value = node.power * std::max(cosEmit, 1e-4f) / clamped2;
  if (node.range < kInfinity) {
    const float part = (std::sqrt(distance2) - node.radius) / node.range;
    if (part > 1 + 1e-5f) return 0;
    value *= std::max(1 - sqr(sqr(part)), 1e-4f);
  }
  if (n != Vec3(0)) {
    float cosReceive = -glm::dot(w, n);
    if (twoSided) cosReceive = std::abs(cosReceive);
    const float sinReceive = safeSqrt(1 - sqr(cosReceive));
    const float bound = cosMinus(sinReceive, cosReceive, sinBound, cosBound);
    if (bound < -1e-5f) return 0;
    value *= std::max(bound, 1e-4f);
  }
  return value;
}

uint32_t LightTree::sample(const Vec3& p, const Vec3& n, bool twoSided, float& u, float& probability) const {
  size_t i = 0;
  probability = 1;
  while (nodes_[i].leftLeaves > 0) {
    const size_t left = i + 1, right = i + 2 * nodes_[i].leftLeaves;
    const float a = importance(nodes_[left], p, n, twoSided), b = importance(nodes_[right], p, n, twoSided);
    const float sum = a + b;
    if (!(sum > 0) || !std::isfinite(sum)) {
      probability = 0;
      return 0;
    }
    const float pLeft = leftProbability(a, b);
    if (u < pLeft) {
      u = std::min(u / pLeft, kOneMinusEpsilon);
      probability *= pLeft;
      i = left;
    } else {
      u = std::clamp((u - pLeft) / (1 - pLeft), 0.0f, kOneMinusEpsilon);
      probability *= 1 - pLeft;
      i = right;
    }
  }
  return nodes_[i].light;
}

float LightTree::probability(const Vec3& p, const Vec3& n, bool twoSided, uint32_t light) const {
  const uint32_t target = position_[light];
  if (target == ~0u) return 0;
  size_t i = 0;
  uint32_t first = 0;
  float result = 1;
  while (nodes_[i].leftLeaves > 0) {
    const size_t left = i + 1, right = i + 2 * nodes_[i].leftLeaves;
    const float a = importance(nodes_[left], p, n, twoSided), b = importance(nodes_[right], p, n, twoSided);
    const float sum = a + b;
    if (!(sum > 0) || !std::isfinite(sum)) return 0;
    const float pLeft = leftProbability(a, b);
    if (target < first + nodes_[i].leftLeaves) {
      result *= pLeft;
      i = left;
    } else {
      result *= 1 - pLeft;
      first += nodes_[i].leftLeaves;
      i = right;
    }
  }
  return result;
}

}  // namespace braid
