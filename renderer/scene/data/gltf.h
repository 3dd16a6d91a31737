// SPDX-License-Identifier: Apache-2.0
// glTF 2.0 (.gltf, .glb) to SceneData. A flaw costs only the thing that it is in: what can be rendered is, and what is
// left out is told once a kind, with its JSON pointer. LoadOptions::strict refuses a file for any problem instead.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "renderer/core/log.h"
#include "renderer/scene/data/scene_data.h"

namespace braid {

struct LoadOptions {
  std::optional<int> scene;        // index into scenes; none: the file's default, else 0
  std::string variant;             // KHR_materials_variants name; empty: none
  std::optional<float> frameTime;  // seconds into the animation; none: the rest pose
  double shutter = 0;              // seconds for which things move from frameTime on; 0: they stand still
  std::string animation;           // the clip that frameTime is in, by name or index; empty: the first
  std::string camera;              // name or index of the camera that will look; empty: the first, "none": none
  DefaultLight defaultLight = DefaultLight::Studio;  // what a file without any light or emitter gets
  bool imageBasedLight = true;                       // false: that of the scene gives way to another environment
  float pointRadius = 0;                             // of points and lines, metres in the world; 0: they are not drawn
  bool multiScatter = true;                          // Material::multiScatter of all materials
  bool doubleSided = false;                          // treat every material as double-sided
  bool allowExternal = false;                        // files may lie outside of the folder of the scene
  bool strict = false;                               // refuse a file with any problem, listing all of them
  std::vector<std::string> ignoredExtensions;        // required ones that are unknown but not refused
  bool keepAllAttributes = false;                    // --full: keep uv, colours and tangents that no material reads
};

// Loads and validates a file. Throws SceneError: exit code BadInput (nothing is left to render, the file is unsafe, or
// it has problems and `strict` is set: all of them, one line each), or UnsupportedExtension naming the extensions in
// extensionsRequired that braid does not know. Warnings go to data.warnings and to the sink; flaws of what the picture
// does not use to data.notes.
SceneData loadGltf(const std::string& path, const LoadOptions& options = {}, const LogSink& log = {});

// A file that stays in memory to be posed many times: it is read and checked, and its images are decoded, once.
class SceneFile {
 public:
  // As loadGltf(). The options' frameTime only says whether there will be one.
  explicit SceneFile(const std::string& path, const LoadOptions& options = {}, const LogSink& log = {});
  ~SceneFile();

  // What loadGltf() returns with this frameTime, to the bit. The sink hears each warning once.
  SceneData pose(std::optional<float> frameTime);

 private:
  struct Opened;
  std::unique_ptr<Opened> opened_;
};

}  // namespace braid
