// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/scene/data/scene_defaults.h"
#include "tools/render/render_run.h"
#include "tools/render/render_state.h"
#include "tools/options/turntable.h"
#include "tools/run/run_clock.h"

namespace braid {

namespace {

// Every file of a frame has to have its own name.
void checkNames(const RenderOptions& o) {
  const uint64_t count = o.frames.frames().count();
  if (count == 1) return;
  const auto check = [&](const char* option, const std::string& file) {
    if (!file.empty() && !holdsFrameNumber(file))
      throw Error(ExitCode::Usage, fmt::format("{} {}: {} frames need a place for their number, such as out_####.exr",
                                               option, file, count));
  };
  check("--output", o.image.file);
  check("--png", o.image.png);
  check("--checkpoint", o.checkpoint);
  check("--resume", o.resumeFile);
}

// The options of one frame. What an earlier run has left of it is gone on from without --resume.
RenderOptions optionsOf(const RenderOptions& all, uint64_t frame) {
  RenderOptions o = all;
  for (std::string* file : {&o.image.file, &o.image.png, &o.checkpoint, &o.resumeFile})
    *file = withFrameNumber(*file, frame);
  if (all.frames.plays()) o.scene.frameTime = all.frames.timeOf(frame);
  o.resume = all.resume || (!o.checkpoint.empty() && !o.overwrite);
  return o;
}

// Files of images are there under their names only when they are finished; states tell their passes.
bool isFinished(const RenderOptions& o) {
  const std::vector<std::string> files = o.image.files();
  if (o.overwrite) return false;
  if (files.empty()) return holdsAllPasses(o);
  std::error_code ignored;
  return std::all_of(files.begin(), files.end(),
                     [&](const std::string& file) { return std::filesystem::is_regular_file(file, ignored); });
}

// What is in front of the camera, opened for one frame after the other.
class Frames {
 public:
  explicit Frames(const RenderOptions& o) : options_(o) {}

  OpenedScene open(uint64_t frame) {
    const FrameChoice& frames = options_.frames;
    if (!opener_) begin();
    if (frames.plays()) {
      OpenedScene opened = take(frames.timeOf(frame));
      turn(opened, frame);
      return opened;
    }
    OpenedScene opened;
    opened.reused = scene_ != nullptr;
    if (!scene_) {
      opened = take(options_.scene.frameTime);
      still_ = opened.camera;
      scene_ = std::move(opened.scene);
    }
    opened.scene = std::move(scene_);
    opened.camera = still_;
    turn(opened, frame);
    return opened;
  }

  // What is needed no more; one that does not move serves the next frame.
  void giveBack(std::unique_ptr<Scene> scene) {
    if (!options_.frames.plays()) scene_ = std::move(scene);
  }

 private:
  void begin() {
    SceneChoice choice = options_.scene;
    choice.turntable = options_.frames.turntable > 0;
    if (options_.frames.plays()) choice.frameTime = 0;
    opener_.emplace(choice);
    if (options_.frames.turntable == 0) return;
    const SceneData first = opener_->load(choice.frameTime);  // before anything is laid under it
    axis_ = turntableAxis(worldBounds(first), first.origin);
  }

  OpenedScene take(double time) {
    OpenedScene opened = opener_->open(time);
    if (options_.frames.plays() && opened.scene->data().animations.empty())
      throw Error(ExitCode::Usage, options_.scene.file +
                                       ": has no animation, so that all frames would be alike: leave --frames out, "
                                       "or give --turntable without --fps");
    return opened;
  }

  // The axis is that of the first pose of all, whichever frames are rendered.
  void turn(OpenedScene& opened, uint64_t frame) {
    const uint64_t frames = options_.frames.turntable;
    if (frames == 0) return;
    const glm::dvec3& origin = opened.scene->data().origin;
    const double turns = static_cast<double>(frame % frames) / static_cast<double>(frames);
    turnAbout(axis_, origin, turns, opened.camera);
  }

  const RenderOptions& options_;
  std::optional<SceneOpener> opener_;
  glm::dvec3 axis_{0};
  std::unique_ptr<Scene> scene_;
  CameraData still_;
};

}  // namespace

int renderFrames(const RenderOptions& all) {
  checkNames(all);
  const FrameRange range = all.frames.frames();
  checkOutputs(optionsOf(all, range.first));
  Surroundings around(all);
  Frames frames(all);
  int code = 0;
  double began = 0;
  for (uint64_t i = 0; i < range.count() && !around.interrupted; ++i) {
    const uint64_t frame = range.at(i);
    ImageRun run{optionsOf(all, frame), [&] { return frames.open(frame); }, began, true};
    const bool finished = isFinished(run.options);
    around.json.write("frame", {{"frame", frame}, {"finished", finished}});
    if (!all.scene.quiet)
      fmt::print(
          stderr, "frame {}{}\n", frame,
          finished ? fmt::format(": {} is there already (--overwrite: anew)", run.options.files().front()) : ":");
    if (finished) continue;
    if (i > 0) checkOutputs(run.options);
    const int ended = renderImage(run, around);
    frames.giveBack(std::move(run.scene));
    if (code == 0 || ended == static_cast<int>(ExitCode::Interrupted)) code = ended;
    began = processSeconds();
  }
  around.json.finish();
  return around.interrupted ? static_cast<int>(ExitCode::Interrupted) : code;
}

}  // namespace braid
