// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/sweep_run.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/stopwatch.h"
#include "combiners/statistics/error_map.h"
#include "tools/publish/estimated_error.h"

namespace braid {

namespace {

// Wall-clock time without the stretches between pause() and resume().
class RenderClock {
 public:
  void pause() { total_ += stretch_.seconds(); }
  void resume() { stretch_.restart(); }
  double seconds() const { return total_; }

 private:
  Stopwatch stretch_;
  double total_ = 0;
};

void evaluate(const SweepScene& scene, const SweepJob& job, const SweepJob::Cell& cell,
              const std::shared_ptr<const Estimates>& estimates, const Measurement& measurement,
              const SweepCallbacks& callbacks) {
  const SweepMethod& method = *cell.method;
  SweepRow row;
  row.scene = scene.name;
  row.method = method.name;
  row.ladder = job.ladder;
  row.mark = cell.mark;
  row.seed = job.seed;
  uint64_t rejected = 0;
  for (const MethodShare& input : method.inputs) {
    const Estimate* e = estimates->find(input.integrator);
    BRAID_ASSERT(e);
    row.render += e->seconds;
    rejected += e->rejected;
  }
  const Estimate& first = *estimates->find(method.inputs.front().integrator);
  row.spp = first.passes;
  MethodImage made;
  if (method.finish) {
    made = method.finish(estimates, scene.reference.image.mean);
  } else {
    made.image = first.mean;
    if (first.passes > 1) made.error = relativeError(errorMap(first), squaredLevels(first));
  }
  row.denoise = made.denoiseSeconds;
  row.combine = made.combineSeconds;
  if (made.failed) {
    if (callbacks.onFailure) callbacks.onFailure(row, made.skipReason);
    return;
  }
  if (made.image.empty()) {
    row.values.assign(measurement.columns().size(), std::numeric_limits<double>::quiet_NaN());
    if (callbacks.onSkip) callbacks.onSkip(method, made.skipReason);
  } else {
    row.values = measurement.measure(made, scene.reference.image, method.finish ? &first.mean : nullptr, rejected);
  }
  if (callbacks.onRow) callbacks.onRow(row, made.image);
}

Plan planOf(const SweepScene& scene, Settings settings, const SweepJob& job,
            const std::vector<const Integrator*>& integrators) {
  const std::vector<MethodShare> inputs = job.inputs();
  settings.integrators.clear();
  for (const MethodShare& i : inputs) settings.integrators.push_back(i.integrator);
  settings.seed = job.seed;
  settings.seconds = 0;
  settings.spp = job.ladder == Ladder::Samples ? static_cast<uint64_t>(job.lastMark()) : 0;
  settings.keep = job.buffers;
  Plan plan = makePlan(*scene.scene, scene.camera, settings, integrators);
  BRAID_ASSERT(plan.integrators.size() == inputs.size());
  for (size_t i = 0; i < inputs.size(); ++i) plan.integrators[i].passesPerRound = inputs[i].passes;
  return plan;
}

}  // namespace

std::vector<const Metric*> chooseMetrics(const std::vector<std::string>& names) {
  std::vector<const Metric*> chosen;
  std::string known;
  for (const Metric& m : metricRegistry()) {
    known += (known.empty() ? "" : ", ") + std::string(m.name);
    if (names.empty()) chosen.push_back(&m);
  }
  for (const std::string& name : names) {
    const Metric* m = findMetric(name);
    if (!m) throw Error(ExitCode::Usage, fmt::format("--metric: unknown metric '{}'; known are {}", name, known));
    if (std::find(chosen.begin(), chosen.end(), m) == chosen.end()) chosen.push_back(m);
  }
  if (chosen.front()->largerIsBetter)
    throw Error(ExitCode::Usage, fmt::format("--metric: {} is better when larger; name an error first, such as relL2",
                                             chosen.front()->name));
  return chosen;
}

std::vector<std::string> Measurement::columns() const {
  std::vector<std::string> names;
  for (const Metric* m : metrics) names.push_back(m->name);
  for (const char* name : {"relL2_trimmed", "relL2_unbiased", "estimated_error", "better_pixels", "squared_difference",
                           "invalid_pixels", "rejected_samples"})
    names.push_back(name);
  return names;
}

std::vector<double> Measurement::measure(const MethodImage& made, const ReferenceImage& reference,
                                         const Rgb<float>* baseline, uint64_t rejected) const {
  const Rgb<float>& image = made.image;
  std::vector<double> values;
  for (const Metric* m : metrics) values.push_back(evaluate(*m, image, reference.mean).value);
  const MetricResult trimmed = evaluate(*findMetric("relL2"), image, reference.mean, 100 * cropWorst);
  values.push_back(trimmed.value);
  values.push_back(relL2Unbiased(image, reference));
  values.push_back(made.error.value_or(std::numeric_limits<double>::quiet_NaN()));
  Dominance d{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  if (baseline) d = dominance(image, *baseline, reference.mean);
  values.push_back(d.betterPixels);
  values.push_back(d.squaredDifference);
  values.push_back(static_cast<double>(trimmed.invalid));
  values.push_back(static_cast<double>(rejected));
  return values;
}

std::string plannedIntegrators(const SweepScene& scene, Settings settings,
                               const std::vector<const Integrator*>& integrators) {
  settings.integrators = {"auto"};
  settings.spp = 64;
  std::string names;
  for (const PlannedIntegrator& i : makePlan(*scene.scene, scene.camera, settings, integrators).integrators)
    names += (names.empty() ? "" : "+") + std::string(i.integrator->name());
  return names;
}

double SweepJob::lastMark() const {
  double last = 0;
  for (const Cell& c : cells) last = std::max(last, c.mark);
  return last;
}

std::vector<MethodShare> SweepJob::inputs() const {
  std::vector<MethodShare> inputs;
  for (const bool reads : {true, false})  // the first integrator makes the features
    for (const Cell& c : cells)
      for (const MethodShare& i : c.method->inputs)
        if (c.method->buffers.features == reads && std::find(inputs.begin(), inputs.end(), i) == inputs.end())
          inputs.push_back(i);
  return inputs;
}

double SweepJob::passesPerRound() const {
  double passes = 0;
  for (const MethodShare& i : inputs()) passes += i.passes;
  return passes;
}

bool runSweepJob(const SweepScene& scene, const Settings& base, const std::vector<const Integrator*>& integrators,
                 const Measurement& measurement, const SweepJob& job, const SweepCallbacks& callbacks) {
  Session session(*scene.scene, planOf(scene, base, job, integrators));
  std::vector<SweepJob::Cell> open = job.cells;
  RenderClock clock;
  session.run(
      [&](const Progress& progress) {
        clock.pause();
        const double reached = job.ladder == Ladder::Samples ? static_cast<double>(progress.round) : clock.seconds();
        const auto later =
            std::stable_partition(open.begin(), open.end(), [&](const SweepJob::Cell& c) { return c.mark <= reached; });
        if (later != open.begin()) {
          const std::shared_ptr<const Estimates> estimates = session.snapshot();
          for (auto c = open.begin(); c != later; ++c) evaluate(scene, job, *c, estimates, measurement, callbacks);
          open.erase(open.begin(), later);
        }
        if (callbacks.onRound) callbacks.onRound(progress.round, clock.seconds());
        clock.resume();
        return !open.empty();
      },
      callbacks.cancel);
  return open.empty();
}

}  // namespace braid
