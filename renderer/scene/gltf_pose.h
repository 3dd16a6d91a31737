// SPDX-License-Identifier: Apache-2.0
// Where every node stands at one moment of the animation.
#pragma once

#include <vector>

#include "renderer/scene/gltf.h"
#include "renderer/scene/gltf_document.h"

namespace braid::gltf {

struct Pose {
  std::vector<glm::dmat4> world;            // by node
  std::vector<std::vector<float>> weights;  // of the morph targets of the node's mesh
  std::vector<bool> visible;                // with all ancestors
};

// Applies the animations to the nodes of the document and multiplies transforms down the tree. The document must be
// valid.
Pose makePose(Document& document, const LoadOptions& options);

// Applies all channels of the chosen animations at `time`. gltf_animation.cpp
void animate(Document& document, std::optional<int> animation, float time);

// Reads the joint matrices of a skin: joint to world times inverse bind.
std::vector<glm::mat4> jointMatrices(const Document& document, const Pose& pose, const Skin& skin);

// How many times EXT_mesh_gpu_instancing repeats the node's mesh.
uint64_t instanceCount(const Document& document, const Node& node);

// The local transforms of EXT_mesh_gpu_instancing; one identity if the node has none.
std::vector<glm::dmat4> instanceTransforms(const Document& document, const Node& node);

}  // namespace braid::gltf
