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

// A point that a light is to be picked for, and the light.
struct LightQuery {
  Vec3 position;
  Vec3 normal;            // zero: no receiver cosine
  bool twoSided = false;  // both sides of the normal receive
  float u = 0;            // a uniform variate
  uint32_t light = 0;
  float probability = 0;  // of the light; 0: nothing can contribute
};

class LightTree {
 public:
  static constexpr size_t kMostQueries = 64;  // that are worked on at once

  void build(const std::vector<LightBounds>& lights);
  bool empty() const { return position_.empty(); }

  // Picks a light.
  void sample(LightQuery& query) const;
  // The same for each of the queries, the more the better: a step from a node to the next is a long chain of
  // operations, and the processor works on the chains of several queries at once.
  void sample(std::span<LightQuery> queries) const;
  // The probability that the query picks `light`.
  float probability(const LightQuery& query, uint32_t light) const;

  size_t bytes() const { return groups_.size() * sizeof(Group) + position_.size() * sizeof(uint32_t); }

 private:
  // A node, its children and theirs are met together: what importance() reads of six nodes lies side by side.
  // Lanes 0 and 1 are the children, 2 and 3 those of the left one, 4 and 5 those of the right one. A child that is a
  // leaf has itself and nothing below.
  static constexpr int kLanes = 8;  // as vectors are wide; two are never read
  struct Group {
    float centreX[kLanes], centreY[kLanes], centreZ[kLanes], radius[kLanes];
    float axisX[kLanes], axisY[kLanes], axisZ[kLanes];
    float power[kLanes], inside[kLanes], inverseRange[kLanes];
    float cosNormals[kLanes], sinNormals[kLanes], cosEmission[kLanes];
    float twoSided[kLanes];   // 0 or 1
    uint32_t next[4];         // of lanes 2 to 5: a light with kLeaf, or the group below
    uint32_t rightLeaves[3];  // number of the first leaf of the right child: of the node, the left and the right child
  };
  static constexpr uint32_t kLeaf = 1u << 31;

  struct Node {
    LightBounds bounds;
    uint32_t leftLeaves;  // leaves of the left child (which follows the node); 0: a leaf
    uint32_t light;       // of a leaf
  };
  // Depth first: the left child at +1, the right child at +2·leftLeaves.
  using Nodes = std::vector<Node>;
  // Builds the node of some lights and those below it; sorts `order` into the order of the leaves.
  static void buildNode(const std::vector<LightBounds>& lights, std::span<uint32_t> order, Nodes& nodes, size_t node,
                        int depth);
  // The group of a node and those below it; its leaves are numbered from firstLeaf.
  uint32_t addGroup(const Nodes& nodes, size_t node, uint32_t firstLeaf);
  static void setLane(Group& group, size_t lane, const Node& node);

  static constexpr size_t kTogether = 8;  // steps that do not wait for each other
  struct Walks;
  // One step of the walks from `first` to `end`; those that go on move up to `alive`. Returns where the next may go.
  size_t step(Walks& walks, size_t first, size_t end, size_t alive, std::span<LightQuery> queries) const;
  static void importances(const Group& group, const LightQuery& query, float (&out)[kLanes]);

  uint32_t root_ = kLeaf;           // as Group::next; without any light that shines, light 0
  std::vector<Group> groups_;       // depth first
  std::vector<uint32_t> position_;  // of each light among the leaves
};

}  // namespace braid
