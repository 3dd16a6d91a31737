// SPDX-License-Identifier: Apache-2.0
// Where every node stands at one moment of the animation.
#pragma once

#include <optional>
#include <vector>

#include "renderer/scene/data/gltf.h"
#include "renderer/scene/gltf/document/gltf_document.h"

namespace braid::gltf {

struct Pose {
  std::vector<glm::dmat4> world;            // by node
  std::vector<std::vector<float>> weights;  // of the morph targets of the node's mesh
  std::vector<bool> visible;                // with all ancestors
};

// Whether a node itself is to be seen (KHR_node_visibility), its ancestors aside.
bool isVisible(const tinygltf::Node& node);

// Applies the chosen animation to the nodes of the document and multiplies transforms down the tree. Throws
// SceneError(Usage) if it has no such animation.
Pose makePose(Document& document, const LoadOptions& options);

// The clip that is asked for, by name, else by index; the first if none is; -1: the file has none. Throws as
// makePose().
int chosenAnimation(const Document& document, const std::string& choice);

// The quaternion of four numbers in glTF's order; 1 if it is zero.
glm::dquat quaternion(const double* xyzw);

// gltf_animation.cpp: applies all channels of a clip at `time`.
void animate(Document& document, int clip, float time);

// gltf_animation.cpp: the values of the document's properties at `time` of a clip; none: it does not move that one.
std::vector<std::optional<std::vector<double>>> animatedValues(Document& document, int clip, float time);

// gltf_pointers.cpp, KHR_animation_pointer. Finds what the pointers of a file lead to: places of nodes become ordinary
// channels, the rest properties of the document.
void resolvePointers(Document& document);
// Gives them their values at the time of the frame; while a shutter is open, at its middle. Materials, cameras and
// lights that change are read again.
void animateProperties(Document& document);

// The last key time of a clip.
double clipSeconds(const Document& document, const tinygltf::Animation& animation);

// Reads the joint matrices of a skin: joint to world times inverse bind; zero for joints that do not exist.
std::vector<glm::dmat4> jointMatrices(const Document& document, const Pose& pose, const tinygltf::Skin& skin);

// EXT_mesh_gpu_instancing of a node: TRANSLATION, ROTATION and SCALE to accessors.
Attributes instancingOf(const tinygltf::Node& node);
// How many times it repeats the node's mesh.
uint64_t instanceCount(const Document& document, const Attributes& instancing);
// Its local transforms; one identity if there are none.
std::vector<glm::dmat4> instanceTransforms(const Document& document, const Attributes& instancing);

// Values of one key of an animated property of a node. 0: it cannot move.
size_t animatedWidth(const Document& document, const tinygltf::AnimationChannel& channel);

}  // namespace braid::gltf
