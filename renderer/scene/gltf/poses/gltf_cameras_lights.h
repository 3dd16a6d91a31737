// SPDX-License-Identifier: Apache-2.0
// Cameras and lights where their nodes stand, as doubles until the scene's zero is known.
#pragma once

#include <string>
#include <vector>

#include "renderer/scene/gltf/poses/gltf_motion.h"

namespace braid::gltf {

class CamerasAndLights {
 public:
  CamerasAndLights(Document& document, SceneData& scene) : document_(document), scene_(scene) {}

  // What a node of the scene carries.
  void addCamera(int node, const PoseSequence& poses);
  void addLight(int node, const PoseSequence& poses);
  // Brings all of them into the coordinates of scene.origin.
  void place();

 private:
  Document& document_;
  SceneData& scene_;
  std::vector<std::vector<glm::dmat4>> cameras_;  // of scene_.cameras at all steps
  std::vector<std::vector<glm::dvec3>> lights_;   // positions of scene_.lights at all steps
};

// Whether a camera, the scene's `number`th, called `name`, is the one that will look (LoadOptions::camera).
inline bool looks(const std::string& wanted, const std::string& name, size_t number) {
  return wanted.empty() ? number == 0 : name == wanted || std::to_string(number) == wanted;
}

// Embree ends the program at rays and transforms beyond 1.8e18: places keep away from that, as vertices do.
bool isWithinReach(const glm::dmat4& m);

std::string nodePlace(int node);
std::string cameraName(const Document& document, int node, size_t number);

}  // namespace braid::gltf
