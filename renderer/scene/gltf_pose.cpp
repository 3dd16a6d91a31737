// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf_pose.h"

#include <algorithm>
#include <cmath>

#include "renderer/scene/gltf_accessor.h"

namespace braid::gltf {

namespace {

glm::dmat4 trs(const glm::dvec3& translation, const glm::dquat& rotation, const glm::dvec3& scale) {
  return glm::scale(glm::translate(glm::dmat4(1), translation) * glm::mat4_cast(rotation), scale);
}

glm::dmat4 localTransform(const Node& node) {
  return node.matrix ? *node.matrix : trs(node.translation, node.rotation, node.scale);
}

// Parents before children, without recursion: trees may be a million levels deep.
std::vector<uint32_t> topDown(const Document& document) {
  std::vector<uint32_t> order;
  order.reserve(document.nodes.size());
  for (uint32_t i = 0; i < document.nodes.size(); ++i) {
    if (document.nodes[i].parent == kNone) order.push_back(i);
  }
  for (size_t i = 0; i < order.size(); ++i) {
    const std::vector<uint32_t>& children = document.nodes[order[i]].children;
    order.insert(order.end(), children.begin(), children.end());
  }
  return order;
}

std::vector<float> morphWeights(const Document& document, const Node& node) {
  if (node.mesh == kNone) return {};
  return node.weights ? *node.weights : document.meshes[node.mesh].weights;
}

// By name, else by index; the first if none is asked for.
const Animation* chosenAnimation(const Document& document, const std::string& choice) {
  const std::vector<Animation>& all = document.animations;
  if (choice.empty()) return all.empty() ? nullptr : &all.front();
  std::string known;
  for (size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == choice) return &all[i];
    known += (i == 0 ? "" : ", ") + std::to_string(i) + (all[i].name.empty() ? "" : " " + quoted(all[i].name));
  }
  for (size_t i = 0; i < all.size(); ++i) {
    if (std::to_string(i) == choice) return &all[i];
  }
  throw SceneError(ExitCode::Usage, document.path, "/animations",
                   "no animation " + quoted(choice) + ": the file has " + (known.empty() ? "none" : known));
}

}  // namespace

Pose makePose(Document& document, const LoadOptions& options) {
  const Animation* animation = chosenAnimation(document, options.animation);
  if (animation && (options.frameTime || !options.animation.empty()))
    animate(document, *animation, options.frameTime.value_or(0.0f));
  const size_t count = document.nodes.size();
  Pose pose{std::vector<glm::dmat4>(count), std::vector<std::vector<float>>(count), std::vector<bool>(count)};
  for (const uint32_t i : topDown(document)) {
    const Node& node = document.nodes[i];
    const bool isRoot = node.parent == kNone;
    pose.world[i] = isRoot ? localTransform(node) : pose.world[node.parent] * localTransform(node);
    pose.visible[i] = node.visible && (isRoot || pose.visible[node.parent]);
    pose.weights[i] = morphWeights(document, node);
  }
  return pose;
}

std::vector<glm::dmat4> jointMatrices(const Document& document, const Pose& pose, const Skin& skin) {
  std::vector<float> inverse;
  if (skin.inverseBindMatrices != kNone) inverse = readFloats(document, skin.inverseBindMatrices);
  std::vector<glm::dmat4> joints;
  for (size_t i = 0; i < skin.joints.size(); ++i) {
    const glm::dmat4 bind =
        16 * i + 16 <= inverse.size() ? glm::dmat4(glm::make_mat4(&inverse[16 * i])) : glm::dmat4(1);
    joints.emplace_back(pose.world[skin.joints[i]] * bind);
  }
  return joints;
}

uint64_t instanceCount(const Document& document, const Node& node) {
  return node.instancing.empty() ? 1 : document.accessors[node.instancing.begin()->second].count;
}

std::vector<glm::dmat4> instanceTransforms(const Document& document, const Node& node) {
  if (node.instancing.empty()) return {glm::dmat4(1)};
  const auto read = [&](const char* name) {
    const auto found = node.instancing.find(name);
    return found == node.instancing.end() ? std::vector<float>() : readFloats(document, found->second);
  };
  const std::vector<float> t = read("TRANSLATION"), r = read("ROTATION"), s = read("SCALE");
  std::vector<glm::dmat4> transforms(std::max({t.size() / 3, r.size() / 4, s.size() / 3}));
  for (size_t i = 0; i < transforms.size(); ++i) {
    const glm::dvec3 translation = t.empty() ? glm::dvec3(0) : glm::dvec3(t[3 * i], t[3 * i + 1], t[3 * i + 2]);
    const glm::dvec3 scale = s.empty() ? glm::dvec3(1) : glm::dvec3(s[3 * i], s[3 * i + 1], s[3 * i + 2]);
    glm::dquat rotation(1, 0, 0, 0);
    if (!r.empty()) {
      const glm::dquat q(r[4 * i + 3], r[4 * i], r[4 * i + 1], r[4 * i + 2]);
      if (glm::length(q) > 1e-6) rotation = glm::normalize(q);
    }
    transforms[i] = trs(translation, rotation, scale);
  }
  return transforms;
}

}  // namespace braid::gltf
