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

// Applies the chosen animation to the nodes of the document and multiplies transforms down the tree. The document must
// be valid. Throws SceneError(Usage) if it has no such animation.
Pose makePose(Document& document, const LoadOptions& options);

// gltf_animation.cpp: applies all channels of a clip at `time`.
void animate(Document& document, const Animation& animation, float time);

// The last key time of a clip.
double clipSeconds(const Document& document, const Animation& animation);

// Reads the joint matrices of a skin: joint to world times inverse bind.
std::vector<glm::dmat4> jointMatrices(const Document& document, const Pose& pose, const Skin& skin);

// How many times EXT_mesh_gpu_instancing repeats the node's mesh.
uint64_t instanceCount(const Document& document, const Node& node);

// The local transforms of EXT_mesh_gpu_instancing; one identity if the node has none.
std::vector<glm::dmat4> instanceTransforms(const Document& document, const Node& node);

}  // namespace braid::gltf
