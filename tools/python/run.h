// SPDX-License-Identifier: Apache-2.0
// A scene and its renders, as Python holds them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "renderer/session/session.h"
#include "tools/options/open_scene.h"
#include "tools/prepare/planned_render.h"
#include "tools/python/made.h"
#include "tools/python/words.h"

namespace braid::python {

struct SceneHolder {
  SceneChoice choice;
  OpenedScene opened;

  SceneHolder(const std::string& file, const Words& words)
      : choice(sceneChoice(file, words)), opened(openScene(choice)) {}
};

// A plan, and the passes that follow it.
class Run {
 public:
  // Throws Error(Usage) for what cannot be planned, Error(OutOfMemory) beyond the limit of memory.
  Run(std::shared_ptr<const SceneHolder> scene, const Words& words);

  std::string planText() const { return planned_.text(); }
  const PlannedRender& planned() const { return planned_; }
  // Passes until the samples or the time of the plan, or until `progress` returns false; what is done is kept.
  void advance(const Session::ProgressCallback& progress);
  // Goes on, to so many samples in all, or for so many seconds; 0: no such limit. Throws Error(Usage).
  void resume(uint64_t spp, double seconds, const Session::ProgressCallback& progress);
  // What there is now, by the methods that were asked for.
  std::shared_ptr<const Made> made();
  // By another choice.
  std::shared_ptr<const Made> made(const CombineChoice& choice);
  Estimates estimates() const;

  const RunReport& report() const { return report_; }
  int threads() const { return choice_.samples.threads; }

 private:
  void begin(uint64_t spp, double seconds);

  std::shared_ptr<const SceneHolder> scene_;
  RenderChoice choice_;
  std::vector<std::unique_ptr<Integrator>> integrators_;
  PlannedRender planned_;
  std::unique_ptr<Session> session_;
  RunReport report_;
  std::shared_ptr<const Made> made_;
};

}  // namespace braid::python
