// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/poses/gltf_pose.h"

#include <algorithm>
#include <cmath>

#include "renderer/scene/gltf/document/gltf_accessor.h"

namespace braid::gltf {

namespace {

glm::dmat4 trs(const glm::dvec3& translation, const glm::dquat& rotation, const glm::dvec3& scale) {
  return glm::scale(glm::translate(glm::dmat4(1), translation) * glm::mat4_cast(rotation), scale);
}

glm::dvec3 vector(const std::vector<double>& v, const glm::dvec3& fallback) {
  return v.size() == 3 ? glm::dvec3(v[0], v[1], v[2]) : fallback;
}

glm::dmat4 localTransform(const tinygltf::Node& node) {
  if (node.matrix.size() == 16) return glm::make_mat4(node.matrix.data());
  const glm::dquat rotation = node.rotation.size() == 4 ? quaternion(node.rotation.data()) : glm::dquat(1, 0, 0, 0);
  return trs(vector(node.translation, glm::dvec3(0)), rotation, vector(node.scale, glm::dvec3(1)));
}

// Parents before children, without recursion: trees may be a million levels deep.
std::vector<int> topDown(const Document& document) {
  std::vector<int> order;
  order.reserve(document.parents.size());
  for (size_t i = 0; i < document.parents.size(); ++i) {
    if (document.parents[i] < 0) order.push_back(static_cast<int>(i));
  }
  for (size_t i = 0; i < order.size(); ++i) {
    const std::vector<int>& children = document.model.nodes[static_cast<size_t>(order[i])].children;
    order.insert(order.end(), children.begin(), children.end());
  }
  return order;
}

std::vector<float> morphWeights(const Document& document, const tinygltf::Node& node) {
  if (node.mesh < 0) return {};
  const std::vector<double>& weights =
      node.weights.empty() ? document.model.meshes[static_cast<size_t>(node.mesh)].weights : node.weights;
  return {weights.begin(), weights.end()};
}

}  // namespace

bool isVisible(const tinygltf::Node& node) {
  const Value& visible = member(member(node.extensions, "KHR_node_visibility"), "visible");
  return !visible.IsBool() || visible.Get<bool>();
}

int chosenAnimation(const Document& document, const std::string& choice) {
  const std::vector<tinygltf::Animation>& all = document.model.animations;
  if (choice.empty()) return all.empty() ? -1 : 0;
  std::string known;
  for (size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == choice) return static_cast<int>(i);
    known += (i == 0 ? "" : ", ") + std::to_string(i) + (all[i].name.empty() ? "" : " " + quoted(all[i].name));
  }
  for (size_t i = 0; i < all.size(); ++i) {
    if (std::to_string(i) == choice) return static_cast<int>(i);
  }
  throw SceneError(ExitCode::Usage, document.path, "/animations",
                   "no animation " + quoted(choice) + ": the file has " + (known.empty() ? "none" : known));
}

glm::dquat quaternion(const double* xyzw) {
  const glm::dquat q(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
  const double length = glm::length(q);
  return length > 1e-6 && std::isfinite(length) ? q / length : glm::dquat(1, 0, 0, 0);
}

Pose makePose(Document& document, const LoadOptions& options) {
  const std::vector<tinygltf::Node>& nodes = document.model.nodes;
  const int clip = chosenAnimation(document, options.animation);
  if (clip >= 0 && (options.frameTime || !options.animation.empty()))
    animate(document, clip, options.frameTime.value_or(0.0f));
  Pose pose{std::vector<glm::dmat4>(nodes.size()), std::vector<std::vector<float>>(nodes.size()),
            std::vector<bool>(nodes.size())};
  for (const int node : topDown(document)) {
    const auto i = static_cast<size_t>(node);
    const bool isRoot = document.parents[i] < 0;
    const auto parent = static_cast<size_t>(std::max(document.parents[i], 0));
    pose.world[i] = isRoot ? localTransform(nodes[i]) : pose.world[parent] * localTransform(nodes[i]);
    pose.visible[i] = isVisible(nodes[i]) && (isRoot || pose.visible[parent]);
    pose.weights[i] = morphWeights(document, nodes[i]);
  }
  return pose;
}

std::vector<glm::dmat4> jointMatrices(const Document& document, const Pose& pose, const tinygltf::Skin& skin) {
  std::vector<float> inverse;
  if (skin.inverseBindMatrices >= 0) inverse = readFloats(document, skin.inverseBindMatrices);
  std::vector<glm::dmat4> joints;
  for (size_t i = 0; i < skin.joints.size(); ++i) {
    const glm::dmat4 bind =
        16 * i + 16 <= inverse.size() ? glm::dmat4(glm::make_mat4(&inverse[16 * i])) : glm::dmat4(1);
    if (skin.joints[i] < 0)
      joints.emplace_back(0.0);
    else
      joints.emplace_back(pose.world[static_cast<size_t>(skin.joints[i])] * bind);
  }
  return joints;
}

Attributes instancingOf(const tinygltf::Node& node) {
  const Value& attributes = member(member(node.extensions, "EXT_mesh_gpu_instancing"), "attributes");
  Attributes out;
  for (const char* name : {"TRANSLATION", "ROTATION", "SCALE"}) {
    if (const int accessor = index(attributes, name); accessor >= 0) out.emplace(name, accessor);
  }
  return out;
}

uint64_t instanceCount(const Document& document, const Attributes& instancing) {
  uint64_t count = instancing.empty() ? 1 : 0;
  for (const auto& [name, accessor] : instancing) count = std::max<uint64_t>(count, document.accessor(accessor).count);
  return count;
}

std::vector<glm::dmat4> instanceTransforms(const Document& document, const Attributes& instancing) {
  if (instancing.empty()) return {glm::dmat4(1)};
  // An attribute of the wrong shape or without an instance of its own at some places says nothing there.
  const auto read = [&](const char* name, uint32_t width) {
    const auto found = instancing.find(name);
    if (found == instancing.end() || componentsOf(document.accessor(found->second)) != width)
      return std::vector<float>();
    return readFloats(document, found->second);
  };
  const std::vector<float> t = read("TRANSLATION", 3), r = read("ROTATION", 4), s = read("SCALE", 3);
  std::vector<glm::dmat4> transforms(std::max({t.size() / 3, r.size() / 4, s.size() / 3}));
  const auto at = [](const std::vector<float>& v, size_t i, double fallback) {
    return 3 * i + 3 <= v.size() ? glm::dvec3(v[3 * i], v[3 * i + 1], v[3 * i + 2]) : glm::dvec3(fallback);
  };
  for (size_t i = 0; i < transforms.size(); ++i) {
    double q[4] = {0, 0, 0, 1};
    if (4 * i + 4 <= r.size()) std::copy_n(&r[4 * i], 4, q);
    transforms[i] = trs(at(t, i, 0), quaternion(q), at(s, i, 1));
  }
  return transforms;
}

}  // namespace braid::gltf
