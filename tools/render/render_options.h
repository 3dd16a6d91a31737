// SPDX-License-Identifier: Apache-2.0
// What `braid render` is asked for.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/options/frames.h"
#include "tools/options/scene_options.h"
#include "tools/publish/image_output.h"
#include "tools/publish/tev_client.h"

namespace braid {

struct RenderOptions {
  SceneChoice scene;
  FrameChoice frames;
  SampleChoice samples;
  ImageOutput image;
  std::string logJson, checkpoint, resumeFile;
  std::optional<PassInterval> passes;
  std::optional<TevAddress> tev;
  double saveEvery = 60;  // seconds
  double error = 0;       // 0: no target
  bool resume = false, overwrite = false, transparent = false;

  // What the run leaves behind.
  std::vector<std::string> files() const {
    std::vector<std::string> list = image.files();
    if (!checkpoint.empty()) list.push_back(checkpoint);
    return list;
  }
};

}  // namespace braid
