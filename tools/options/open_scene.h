// SPDX-License-Identifier: Apache-2.0
// From a choice on the command line to a scene that rays can be sent into.
#pragma once

#include <memory>

#include "renderer/scene/scene.h"
#include "tools/options/scene_options.h"

namespace braid {

struct OpenedScene {
  std::unique_ptr<Scene> scene;
  CameraData camera;
  double loadSeconds = 0;  // reading and decoding
  bool reused = false;     // by an earlier frame: nothing was built
};

// The files of a scene, opened once for any number of poses.
class SceneOpener {
 public:
  explicit SceneOpener(const SceneChoice& choice);
  // Everything that the choice changes in the file (environment, light scale) included. `frameTime` as in SceneChoice.
  SceneData load(double frameTime);
  OpenedScene open(double frameTime);

 private:
  const SceneChoice choice_;
  SceneFile file_;
  std::shared_ptr<const Image> environment_;
};

// Loads, chooses the camera and builds; warnings go to standard error unless quiet.
OpenedScene openScene(const SceneChoice& choice);

// Its parts. Loads the file with everything the choice changes in it (environment, light scale).
SceneData loadScene(const SceneChoice& choice);
// The camera that the choice names. Throws Error(Usage) listing the cameras when there is none of that name.
CameraData chooseCamera(const SceneData& data, const SceneChoice& choice);
// Gives the camera the lens that the choice has, focused in the scene. Throws Error(Usage).
void fitLens(const Scene& scene, const SceneChoice& choice, CameraData& camera);
// Builds what rays need, and adds the default light where the camera would see next to nothing.
std::unique_ptr<Scene> buildScene(SceneData data, const SceneChoice& choice, const CameraData& camera);

}  // namespace braid
