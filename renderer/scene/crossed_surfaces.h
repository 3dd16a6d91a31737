// SPDX-License-Identifier: Apache-2.0
// Partly covered surfaces between two points, of which a ray that asks for the light between them takes the exact
// share.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

namespace braid {

// Embree finds them in any order, and some of them twice.
class CrossedSurfaces {
 public:
  static constexpr int kMost = 64;  // more hide what lies behind them

  // A triangle met at t and the barycentric weights (1-u-v, u, v), which lets this share of the light pass; it counts
  // once, and so does the edge between two of a mesh, where both are met. False where there are too many.
  bool add(uint32_t instance, uint32_t mesh, uint32_t triangle, float u, float v, float t, float passing) {
    const bool edge = std::min({u, v, 1 - u - v}) < kEdge;
    const Surface found{instance, mesh, edge ? kAnyTriangle : triangle};
    for (int i = 0; i < count_; ++i) {
      const auto k = static_cast<size_t>(i);
      if (surfaces_[k] != found) continue;
      shares_[k] = std::min(shares_[k], {passing, t});
      return true;
    }
    if (count_ == kMost) return false;
    surfaces_[static_cast<size_t>(count_)] = found;
    shares_[static_cast<size_t>(count_++)] = {passing, t};
    return true;
  }

  // The share of the light that passes all that lie before t: the same bits in whatever order they were found.
  float passing(float t) {
    std::sort(shares_.begin(), shares_.begin() + count_);
    float product = 1;
    for (int i = 0; i < count_; ++i) {
      const auto& [share, at] = shares_[static_cast<size_t>(i)];
      if (at < t) product *= share;
    }
    return product;
  }

 private:
  static constexpr float kEdge = 1e-5f;
  static constexpr uint32_t kAnyTriangle = ~0u;
  struct Surface {
    uint32_t instance, mesh, triangle;
    bool operator==(const Surface&) const = default;
  };
  int count_ = 0;
  std::array<Surface, kMost> surfaces_;
  std::array<std::pair<float, float>, kMost> shares_;  // and t
};

}  // namespace braid
