// SPDX-License-Identifier: Apache-2.0
// The pass loop: rounds of passes until samples, time or the caller end it; nothing here depends on which integrators
// exist.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "renderer/core/log.h"
#include "renderer/film/estimates.h"
#include "renderer/session/integrator.h"
#include "renderer/session/plan.h"

namespace braid {

enum class StopReason { Samples, Time, Cancelled };
const char* toString(StopReason reason);

struct Progress {
  uint64_t round = 0;       // rounds done
  uint64_t rounds = 0;      // planned, 0: no limit
  double seconds = 0;       // since the loop started
  double secondsLeft = -1;  // estimate, negative: unknown
  uint64_t rejected = 0;
};

struct RenderResult {
  std::shared_ptr<const Estimates> estimates;
  Rgb<float> image;                   // the headline
  std::optional<Plane<float>> alpha;  // with a transparent background
  StopReason reason = StopReason::Samples;
  uint64_t rounds = 0;
  double seconds = 0;  // of the pass loop
  uint64_t paths = 0, rays = 0, shadowRays = 0;
  uint64_t rejected = 0;
  // One rejected sample, if any, so that its path can be replayed.
  struct RejectedSample {
    std::string integrator;
    uint64_t pass = 0;
    int x = 0, y = 0;
  };
  std::optional<RejectedSample> firstRejected;
};

class Session {
 public:
  // The scene must outlive the session.
  Session(const Scene& scene, Plan plan);

  // Called after each round; return false to end the render (what is done is kept).
  using ProgressCallback = std::function<bool(const Progress&)>;

  // Runs the plan. `cancel`: set by a signal handler or another thread; the pass in flight is finished. `abandon`: the
  // pass in flight is dropped.
  RenderResult run(const ProgressCallback& progress = {}, const std::atomic<bool>* cancel = nullptr,
                   const std::atomic<bool>* abandon = nullptr);

  const Plan& plan() const { return plan_; }
  const TransportContext& context() const { return context_; }

  // The estimates so far; call it from the progress callback or after run().
  std::shared_ptr<const Estimates> snapshot() const;

 private:
  // Adds the present state of all estimates to the history.
  void keepCheckpoints();

  const Scene& scene_;
  Plan plan_;
  TransportContext context_;
  std::vector<Accumulator> accumulators_;
  std::vector<double> seconds_;
  std::map<std::string, std::vector<Checkpoint>> history_;
  std::unique_ptr<FeatureAccumulator> features_;
  std::unique_ptr<CoverageAccumulator> coverage_;  // with a transparent background
};

}  // namespace braid
