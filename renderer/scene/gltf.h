// SPDX-License-Identifier: Apache-2.0
// glTF 2.0 (.gltf, .glb) to SceneData. Every problem of a broken file is found in one run and listed with its JSON
// pointer.
#pragma once

#include <optional>
#include <string>

#include "renderer/core/log.h"
#include "renderer/scene/scene_data.h"

namespace braid {

struct LoadOptions {
  std::optional<int> scene;        // index into scenes; none: the file's default, else 0
  std::string variant;             // KHR_materials_variants name; empty: none
  std::optional<float> frameTime;  // seconds into the animation; none: the rest pose
  std::string animation;           // the clip that frameTime is in, by name or index; empty: the first
  bool defaultLight = true;        // add a grey dome to a file without any light or emitter
  bool doubleSided = false;        // treat every material as double-sided
  bool allowExternal = false;      // follow symbolic links out of the folder of the file
  bool keepAllAttributes = false;  // --full: keep uv, colours and tangents that no material reads
};

// Loads and validates a file. Throws SceneError: exit code BadInput (all problems, one line each), or
// UnsupportedExtension naming the extensions in extensionsRequired that braid does not know. Warnings go to
// data.warnings and to the sink.
SceneData loadGltf(const std::string& path, const LoadOptions& options = {}, const LogSink& log = {});

}  // namespace braid
