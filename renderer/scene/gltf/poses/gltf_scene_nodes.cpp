// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/poses/gltf_scene_nodes.h"

#include <algorithm>

#include "renderer/scene/gltf/poses/gltf_cameras_lights.h"
#include "renderer/scene/gltf/poses/gltf_pose.h"

namespace braid::gltf {

namespace {

std::vector<int> rootsOfScene(Document& document, const LoadOptions& options) {
  const std::vector<tinygltf::Scene>& scenes = document.model.scenes;
  if (options.scene && (*options.scene < 0 || static_cast<size_t>(*options.scene) >= scenes.size())) {
    throw SceneError(ExitCode::BadInput, document.path, "/scenes",
                     "scene " + std::to_string(*options.scene) + " was asked for, but the file has " +
                         counted(scenes.size(), "scene", "scenes"));
  }
  const int chosen = options.scene ? *options.scene : std::max(document.model.defaultScene, 0);
  document.usage.mark("scenes", chosen);
  if (!scenes.empty()) return scenes[static_cast<size_t>(chosen)].nodes;
  document.report.warn("", "the file has no scene; all its nodes are shown");
  std::vector<int> roots;
  for (size_t i = 0; i < document.parents.size(); ++i) {
    if (document.parents[i] < 0) roots.push_back(static_cast<int>(i));
  }
  return roots;
}

}  // namespace

std::vector<int> nodesOfScene(Document& document, const LoadOptions& options) {
  std::vector<int> order, stack = rootsOfScene(document, options);
  std::reverse(stack.begin(), stack.end());
  std::vector<bool> seen(document.model.nodes.size(), false);
  while (!stack.empty()) {
    const int node = stack.back();
    stack.pop_back();
    if (node < 0 || seen[static_cast<size_t>(node)]) continue;
    seen[static_cast<size_t>(node)] = true;
    document.usage.mark("nodes", node);
    order.push_back(node);
    const std::vector<int>& children = document.model.nodes[static_cast<size_t>(node)].children;
    stack.insert(stack.end(), children.rbegin(), children.rend());
  }
  return order;
}

std::vector<int> nodesThatShow(const Document& document, const LoadOptions& options, const std::vector<int>& nodes) {
  std::vector<int> list;
  std::vector<bool> hidden(document.parents.size(), false);
  size_t cameras = 0;
  for (const int node : nodes) {
    const tinygltf::Node& source = document.model.nodes[static_cast<size_t>(node)];
    const int parent = document.parents[static_cast<size_t>(node)];
    const bool unseen = !isVisible(source) || (parent >= 0 && hidden[static_cast<size_t>(parent)]);
    hidden[static_cast<size_t>(node)] = unseen;
    const bool camera = source.camera >= 0 && looks(options.camera, cameraName(document, node, cameras), cameras);
    cameras += source.camera >= 0 ? 1 : 0;
    const bool light = member(source.extensions, "KHR_lights_punctual").IsObject();
    if (camera || (!unseen && (light || source.mesh >= 0))) list.push_back(node);
    if (unseen || source.mesh < 0 || source.skin < 0) continue;
    for (const int joint : document.model.skins[static_cast<size_t>(source.skin)].joints)
      if (joint >= 0) list.push_back(joint);
  }
  std::sort(list.begin(), list.end());
  list.erase(std::unique(list.begin(), list.end()), list.end());
  return list;
}

}  // namespace braid::gltf
