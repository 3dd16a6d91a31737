// SPDX-License-Identifier: Apache-2.0
// One image of `braid render`, from its options to its files; and many of them, frame by frame.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tools/render/render_options.h"
#include "tools/options/open_scene.h"
#include "tools/prepare/open_modules.h"
#include "tools/publish/publisher.h"
#include "tools/run/interrupt.h"
#include "tools/run/progress_line.h"

namespace braid {

// What goes to the viewer of --tev with each publication, and what it says of it.
class Viewer {
 public:
  explicit Viewer(const RenderOptions& o);
  // `image` with the viewer; this must outlive its use.
  ImageOutput with(ImageOutput image);
  // What could not be shown, as a publication that failed.
  void addFailure(std::vector<Publication>& news);

 private:
  const std::string title_;
  std::optional<TevClient> tev_;
};

// What a run deals with besides its pixels.
struct Surroundings {
  explicit Surroundings(const RenderOptions& o) : viewer(o), json(o.logJson), interrupted(installInterruptHandler()) {}

  Viewer viewer;
  JsonLog json;
  const std::atomic<bool>& interrupted;
  OpeningModules modules;
};

struct ImageRun {
  RenderOptions options;
  std::function<OpenedScene()> open;
  double began = 0;  // by the clock of the process; limits and reports count from here
  // More images follow: memory is given back, and a file is there under its name only when it is finished.
  bool oneOfMany = false;
  std::unique_ptr<Scene> scene{};  // afterwards, of one of many: what it was of
};

// Throws Error(Usage) for outputs that collide or would be lost.
void checkOutputs(const RenderOptions& options);

// Renders and writes. Returns the exit code.
int renderImage(ImageRun& run, Surroundings& around);

// render_frames.cpp: the frames of RenderOptions::frames, those that are finished left out. The exit code is that of an
// interruption, or the first that is not 0.
int renderFrames(const RenderOptions& options);

}  // namespace braid
