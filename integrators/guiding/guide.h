// SPDX-License-Identifier: Apache-2.0
// What was learned of where light comes from: a density of directions for every region of surfaces, read-only while
// passes run (integrators/README.md, Path guiding).
#pragma once

#include <array>

#include "integrators/guiding/directional_tree.h"

namespace braid {

// Surfaces are told apart by the axis that their normal lies nearest to, and by whether their lobes are narrow: both
// sides of a wall, a floor and the wall on it, a mirror and what stands before it receive other light.
inline constexpr int kGuideClasses = 12;
int guideClass(const Vec3& normal, bool narrow);

// Directions of a class as its densities have them: z is the axis of its normals.
Vec3 toGuideAxes(int guideClass, const Vec3& w);
Vec3 fromGuideAxes(int guideClass, const Vec3& w);

struct GuideRegion {
  uint32_t table = 0;  // of Guide::table()
  float share = 0;     // of the guide in what is sampled; 0: the BSDF alone
};

// A tree of planes at right angles to the axes over one class of surfaces. Children lie beside each other.
struct SpatialNode {
  static constexpr uint32_t kLeaf = 3;
  float split = 0;
  uint32_t axis : 2 = kLeaf;
  uint32_t index : 30 = 0;  // of the lower child, or of the region
};

class Guide {
 public:
  Guide() { root_.fill(0); }

  // The region of a point; null where nothing was learned or the guide does not pay.
  const GuideRegion* find(int guideClass, const Vec3& position) const {
    const GuideRegion& region = regions_[leafOf(guideClass, position)];
    return region.share > 0 ? &region : nullptr;
  }
  const DirectionalTable& table(const GuideRegion& region) const { return tables_[region.table]; }
  size_t regions() const { return regions_.size() - 1; }
  size_t bytes() const {
    return tables_.size() * sizeof(DirectionalTable) + nodes_.size() * sizeof(SpatialNode) +
           regions_.size() * sizeof(GuideRegion);
  }

 private:
  friend class GuideBuilder;

  // Index of the region, 0: none.
  uint32_t leafOf(int guideClass, const Vec3& position) const {
    const SpatialNode* node = &nodes_[root_[static_cast<size_t>(guideClass)]];
    while (node->axis != SpatialNode::kLeaf)
      node = &nodes_[node->index + (position[static_cast<int>(node->axis)] >= node->split ? 1u : 0u)];
    return node->index;
  }

  std::array<uint32_t, kGuideClasses> root_;
  std::vector<SpatialNode> nodes_{SpatialNode{}};
  std::vector<GuideRegion> regions_{GuideRegion{}};  // the first one: nothing was learned
  std::vector<DirectionalTable> tables_;
};

}  // namespace braid
