// SPDX-License-Identifier: Apache-2.0
// Where the nodes stand while the shutter is open: at as few moments as straight lines between them allow, and on both
// sides of every jump.
#pragma once

#include <vector>

#include "renderer/scene/gltf/poses/gltf_pose.h"

namespace braid::gltf {

// Straight pieces at most: a full turn is then off by 1/52 of its radius.
inline constexpr size_t kMostPieces = 16;

struct PoseSequence {
  Pose first;                // at the opening
  std::vector<Pose> later;   // at the steps 1, 2, …; empty: nothing moves
  SceneMotion motion;        // the times of all steps
  std::vector<bool> moves;   // by node; empty: none does
  std::vector<bool> morphs;  // by node: the weights of its targets change
  bool moved(int node) const { return !moves.empty() && moves[static_cast<size_t>(node)]; }
  bool morphed(int node) const { return !morphs.empty() && morphs[static_cast<size_t>(node)]; }
  const Pose& step(size_t k) const { return k == 0 ? first : later[k - 1]; }
};

// `shown` are the nodes that the picture depends on: those that carry what is seen, lights, the camera that looks, and
// joints. The document's nodes are left in the first pose.
PoseSequence posesWhileOpen(Document& document, const LoadOptions& options, const std::vector<int>& shown);

}  // namespace braid::gltf
