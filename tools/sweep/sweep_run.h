// SPDX-License-Identifier: Apache-2.0
// Runs the sessions of a sweep: one render serves every method that reads its estimates, and every rung of the ladder
// is a snapshot of the running session.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "renderer/session/session.h"
#include "tools/metrics/metrics.h"
#include "tools/sweep/methods/sweep_method.h"
#include "tools/sweep/sweep_reference.h"
#include "tools/sweep/table/sweep_table.h"

namespace braid {

// The metrics of these names, each once; all for an empty list. Throws Error(Usage) for an unknown one, and when the
// first one, which curves and ratios are about, is better when larger.
std::vector<const Metric*> chooseMetrics(const std::vector<std::string>& names);

// What is measured of an image besides the metrics: see measure().
struct Measurement {
  std::vector<const Metric*> metrics;
  double cropWorst = 0.001;  // fraction of the pixels, those with the largest errors, left out of relL2_trimmed

  // Names of the columns: the metrics, then relL2_trimmed, relL2_unbiased, estimated_error (what the method says of
  // itself, in the units of relL2), better_pixels, squared_difference, invalid_pixels and rejected_samples.
  std::vector<std::string> columns() const;
  // Values of those columns. `baseline`: the mean of the method's first input; null for that mean itself.
  std::vector<double> measure(const MethodImage& made, const ReferenceImage& reference, const Rgb<float>* baseline,
                              uint64_t rejected) const;
};

// A scene in memory with everything that its cells need.
struct SweepScene {
  std::string name, file;
  std::unique_ptr<Scene> scene;
  CameraData camera;
  std::string options;  // what options change in the file: changedOptions()
  std::string planned;  // the integrators that `auto` keeps for it, joined by '+'
  SweepReference reference;
  double loadSeconds = 0;
};

// The integrators that `auto` keeps for the scene, joined by '+'.
std::string plannedIntegrators(const SweepScene& scene, Settings settings,
                               const std::vector<const Integrator*>& integrators);

// Cells of one session: methods × marks that have no row yet.
struct SweepJob {
  Ladder ladder = Ladder::Samples;
  uint64_t seed = 0;
  struct Cell {
    const SweepMethod* method;
    double mark;
  };
  std::vector<Cell> cells;
  // What the estimates hold: by all methods of the group, done or not, so that a resumed job adds up the same buckets.
  KeptBuffers buffers;

  double lastMark() const;
  // Integrators and passes of a round, each integrator once.
  std::vector<MethodShare> inputs() const;
  double passesPerRound() const;
};

struct SweepCallbacks {
  // A method that could not run on so few samples has a row without values and an empty image.
  std::function<void(const SweepRow&, const Rgb<float>& image)> onRow;
  std::function<void(const SweepMethod&, const std::string& skipReason)> onSkip;
  // A method that was run and failed has no row, so that the next run of the sweep tries it again.
  std::function<void(const SweepRow&, const std::string& skipReason)> onFailure;
  // Rounds done and render seconds so far, without the time spent on denoising and measuring.
  std::function<void(uint64_t rounds, double seconds)> onRound;
  const std::atomic<bool>* cancel = nullptr;
};

// Renders with the base settings (size, depth, sampler, threads) until every cell has its row. A rung of the time
// ladder is taken after the first round past it. Returns false when cancelled before the last cell.
bool runSweepJob(const SweepScene& scene, const Settings& base, const std::vector<const Integrator*>& integrators,
                 const Measurement& measurement, const SweepJob& job, const SweepCallbacks& callbacks);

}  // namespace braid
