// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/poses/gltf_cameras_lights.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "renderer/scene/data/placement.h"

namespace braid::gltf {

namespace {

// Scale does not apply to cameras: only where the node stands, its backward axis and which way is up. Nothing where
// the transform does not tell.
std::optional<glm::dmat4> cameraTransform(const glm::dmat4& world) {
  const glm::dmat3 axes = axesOf(world);
  const glm::dvec3 back = axes[2], up = axes[1];
  const glm::dvec3 side = glm::cross(up, back);
  if (!(glm::length(side) > 1e-30) || !isWithinReach(world)) return std::nullopt;
  const glm::dvec3 z = glm::normalize(back), x = glm::normalize(side);
  return glm::dmat4(glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0), glm::dvec4(z, 0), world[3]);
}

std::optional<Vec3> lightDirection(PunctualKind kind, const glm::dmat4& world) {
  const glm::dvec3 direction = kind == PunctualKind::Point ? glm::dvec3(0, 0, -1) : -axesOf(world)[2];
  if (!(glm::length(direction) > 1e-30) || !isWithinReach(world)) return std::nullopt;
  return Vec3(glm::normalize(direction));
}

// Calls place(world) for the steps of a node that moves; what cannot be told stays as it was.
template <class Place>
void forLaterSteps(const PoseSequence& poses, int node, const Place& place) {
  if (!poses.moved(node)) return;
  for (const Pose& pose : poses.later) place(pose.world[static_cast<size_t>(node)]);
}

}  // namespace

std::string nodePlace(int node) { return "/nodes/" + std::to_string(node); }

bool isWithinReach(const glm::dmat4& m) {
  const double* v = glm::value_ptr(m);
  return std::all_of(v, v + 16, [](double x) { return std::abs(x) < 1e17; });
}

std::string cameraName(const Document& document, int node, size_t number) {
  const tinygltf::Node& source = document.model.nodes[static_cast<size_t>(node)];
  if (!source.name.empty()) return source.name;
  const std::string& name = document.cameras[static_cast<size_t>(source.camera)].name;
  return name.empty() ? "camera " + std::to_string(number) : name;
}

void CamerasAndLights::addCamera(int index, const PoseSequence& poses) {
  const tinygltf::Node& node = document_.model.nodes[static_cast<size_t>(index)];
  if (node.camera < 0) return;
  CameraData camera = document_.cameras[static_cast<size_t>(node.camera)];
  camera.name = cameraName(document_, index, scene_.cameras.size());
  const std::optional<glm::dmat4> at = cameraTransform(poses.first.world[static_cast<size_t>(index)]);
  if (!at) {
    document_.report.warn(nodePlace(index),
                          "a camera's node has a singular or endless transform; the camera is left out");
    return;
  }
  // Flaws matter only in the camera that looks.
  if (looks(document_.options.camera, camera.name, scene_.cameras.size())) document_.usage.mark("cameras", node.camera);
  std::vector<glm::dmat4>& steps = cameras_.emplace_back();
  steps.push_back(*at);
  forLaterSteps(poses, index,
                [&](const glm::dmat4& world) { steps.push_back(cameraTransform(world).value_or(steps.back())); });
  scene_.cameras.push_back(std::move(camera));
}

void CamerasAndLights::addLight(int index, const PoseSequence& poses) {
  const tinygltf::Node& node = document_.model.nodes[static_cast<size_t>(index)];
  const int source = gltf::index(member(node.extensions, "KHR_lights_punctual"), "light");
  if (source < 0) return;
  document_.usage.mark("lights", source);
  PunctualLight light = document_.lights[static_cast<size_t>(source)];
  if (!node.name.empty()) light.name = node.name;
  const glm::dmat4& at = poses.first.world[static_cast<size_t>(index)];
  const std::optional<Vec3> direction = lightDirection(light.kind, at);
  if (!direction) {
    document_.report.warn(nodePlace(index),
                          "a light's node has a singular or endless transform; the light is left out");
    return;
  }
  light.direction = *direction;
  std::vector<glm::dvec3>& positions = lights_.emplace_back();
  positions.emplace_back(at[3]);
  forLaterSteps(poses, index, [&](const glm::dmat4& world) {
    const Vec3& before = light.steps.empty() ? light.direction : light.steps.back().direction;
    const std::optional<Vec3> turned = lightDirection(light.kind, world);
    positions.push_back(turned ? glm::dvec3(world[3]) : positions.back());
    light.steps.push_back({Vec3(0), turned.value_or(before)});
  });
  scene_.lights.push_back(std::move(light));
}

void CamerasAndLights::place() {
  for (size_t i = 0; i < cameras_.size(); ++i) {
    scene_.cameras[i].toWorld = relativeTo(cameras_[i][0], scene_.origin);
    for (size_t k = 1; k < cameras_[i].size(); ++k)
      scene_.cameras[i].steps.push_back(relativeTo(cameras_[i][k], scene_.origin));
  }
  for (size_t i = 0; i < lights_.size(); ++i) {
    scene_.lights[i].position = Vec3(lights_[i][0] - scene_.origin);
    for (size_t k = 1; k < lights_[i].size(); ++k)
      scene_.lights[i].steps[k - 1].position = Vec3(lights_[i][k] - scene_.origin);
  }
}

}  // namespace braid::gltf
