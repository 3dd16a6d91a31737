// SPDX-License-Identifier: Apache-2.0
// The pass loop: rounds of passes until samples, time or the caller end it; nothing here depends on which integrators
// exist.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "renderer/core/log.h"
#include "renderer/film/film_state.h"
#include "renderer/session/integrator.h"
#include "renderer/session/placement_map.h"
#include "renderer/session/plan.h"

namespace braid {

enum class StopReason { Samples, Time, Error, Cancelled };
const char* toString(StopReason reason);

struct Progress {
  uint64_t round = 0;       // rounds done, those of a resumed state included
  uint64_t rounds = 0;      // planned, 0: no limit
  double seconds = 0;       // since the loop started
  double secondsLeft = -1;  // estimate, negative: unknown
  uint64_t rejected = 0;
  // Where samples are placed: the fewest and the most of a pixel so far; else 0.
  uint64_t fewestSamples = 0, mostSamples = 0;
};

// What became of a run, without its images.
struct RunReport {
  StopReason reason = StopReason::Samples;
  uint64_t rounds = 0;                          // those of a resumed state included
  uint64_t firstRound = 0;                      // how many of them were resumed
  uint64_t spp = 0;                             // of the first integrator, in all
  uint64_t fewestSamples = 0, mostSamples = 0;  // Progress
  double placementGain = 0;  // that the last map of this run predicts (makePlacementMap()); 0: no map was made
  double seconds = 0;        // of the pass loop, in this run
  uint64_t paths = 0, rays = 0, shadowRays = 0;
  uint64_t rejected = 0;
  // One rejected sample, if any, so that its path can be replayed.
  struct RejectedSample {
    std::string integrator;
    uint64_t pass = 0;
    int x = 0, y = 0;
  };
  std::optional<RejectedSample> firstRejected;
  std::vector<PlanLine> decisions;  // of the integrators' preparations
};

struct RenderResult : RunReport {
  std::shared_ptr<const Estimates> estimates;
  Rgb<float> image;                   // the headline
  std::optional<Plane<float>> alpha;  // with a transparent background
};

class Session {
 public:
  // The scene must outlive the session.
  Session(const Scene& scene, Plan plan);

  // Called after each round; return false to end the render (what is done is kept).
  using ProgressCallback = std::function<bool(const Progress&)>;

  // Goes on from a state: run() then gives the pixels of a run that was never interrupted. Throws Error(BadInput) with
  // a sentence that begins with `name` when the state belongs to another scene, other options or another braid.
  void resume(FilmState state, const std::string& name);

  // Runs the plan. Set by a signal handler or another thread: `cancel`, the pass in flight is finished; `abandon`, the
  // pass in flight is dropped; `reached`, the image is as good as it was meant to be.
  RenderResult run(const ProgressCallback& progress = {}, const std::atomic<bool>* cancel = nullptr,
                   const std::atomic<bool>* abandon = nullptr, const std::atomic<bool>* reached = nullptr);
  // The same without a copy of the estimates at the end.
  RunReport advance(const ProgressCallback& progress = {}, const std::atomic<bool>* cancel = nullptr,
                    const std::atomic<bool>* abandon = nullptr, const std::atomic<bool>* reached = nullptr);

  // What ends a run in the place of `seconds` of the settings: the seconds that are left for passes, asked between
  // rounds.
  void setTimeLeft(std::function<double()> timeLeft) { timeLeft_ = std::move(timeLeft); }

  // Where the plan places samples, the errors that say where; else, and by default, those of the samples alone. Made of
  // settings.placement, by which states are told apart.
  void placeBy(RelativeErrors errors) { placeBy_ = std::move(errors); }

  const Plan& plan() const { return plan_; }
  const TransportContext& context() const { return context_; }

  // The estimates so far; call these from the progress callback or after run().
  std::shared_ptr<const Estimates> snapshot() const;
  // The same to keep and change.
  Estimates estimates() const;
  std::optional<Plane<float>> alpha() const;
  const FilmState& state() const { return film_; }
  // After the last run: hands out everything that was gathered, so that its memory can be given back.
  FilmState release() { return std::move(film_); }

  // Completes what tells states apart with what the session cannot know, before resume(): the version and build of
  // braid, options that change the scene; and what image headers say of it.
  void identify(const std::string& version, const std::string& build, const std::vector<StateOption>& sceneOptions,
                std::vector<Attribute> attributes);

 private:
  class Loop;
  // Adds the present state of all estimates to the history.
  void keepCheckpoints();

  const Scene& scene_;
  Plan plan_;
  TransportContext context_;
  FilmState film_;
  std::function<double()> timeLeft_;  // or none: by the settings
  RelativeErrors placeBy_ = varianceOverBrightness;
};

}  // namespace braid
