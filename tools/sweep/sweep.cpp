// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/sweep.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include <fmt/format.h>

#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "renderer/images/image_codecs.h"
#include "tools/options/open_scene.h"
#include "tools/prepare/scene_identity.h"
#include "tools/run/interrupt.h"
#include "tools/sweep/sweep_folder.h"
#include "tools/sweep/sweep_inputs.h"
#include "tools/sweep/methods/sweep_pipeline.h"
#include "tools/sweep/sweep_progress.h"
#include "tools/sweep/sweep_run.h"
#include "tools/sweep/table/sweep_summary.h"

namespace braid {

namespace {

// The methods of a scene for which the plan keeps these integrators, joined by '+'.
using MethodsOf = std::function<std::vector<SweepMethod>(const std::string& planned)>;

class Sweep {
 public:
  Sweep(const SweepOptions& options, MethodsOf methods, const std::vector<const Integrator*>& integrators);
  int run(std::ostream& out);

 private:
  struct LadderRungs {
    Ladder ladder;
    std::vector<double> rungs;
  };

  std::vector<SweepJob> jobsOf(const std::string& scene) const;
  void expectWork();
  // False when interrupted.
  bool runScene(size_t index);
  bool findReference(SweepScene& scene);
  bool renderReference(SweepScene& scene, const std::string& integrator);
  void warmUp(const SweepScene& scene, const SweepJob& job) const;
  bool runJob(const SweepScene& scene, const SweepJob& job);
  SweepCallbacks callbacksOf(const SweepScene& scene, const SweepJob& job);
  void warnAboutReference(const SweepScene& scene);
  void warn(const std::string& text);
  // Says which cells failed and which methods never ran; whether there were any.
  bool reportFailures() const;

  SceneChoice choiceOf(const std::string& file) const;

  const SweepOptions& o_;
  MethodsOf methodsOf_;
  std::vector<SweepMethod> methods_;  // of the present scene
  std::vector<const Integrator*> integrators_;
  std::vector<std::string> names_;  // of the scenes
  std::vector<LadderRungs> ladders_;
  Settings settings_;
  Measurement measurement_;
  SweepFolder folder_;
  SweepProgress progress_;
  std::vector<std::string> failures_;               // a line for each cell that was tried and failed
  std::map<std::string, std::string> skipReasons_;  // by method, the last one
  const std::atomic<bool>& interrupted_;
};

Sweep::Sweep(const SweepOptions& options, MethodsOf methods, const std::vector<const Integrator*>& integrators)
    : o_(options),
      methodsOf_(std::move(methods)),
      methods_(methodsOf_("pt")),
      integrators_(integrators),
      names_(sceneNames(options.scenes)),
      folder_(options, measurement_, [this](const std::string& text) { warn(text); }),
      progress_(options.view.quiet),
      interrupted_(installInterruptHandler()) {
  SampleChoice samples;
  samples.sampler = o_.sampler;
  samples.maxDepth = o_.maxDepth;
  samples.threads = o_.threads;
  settings_ = makeSettings(choiceOf(""), samples);
  measurement_.metrics = chooseMetrics(o_.metrics);
  measurement_.cropWorst = o_.cropWorst;
  const std::vector<double> usual = o_.time.empty() ? parseLadder("4:256", false) : std::vector<double>{};
  if (const auto& rungs = o_.spp.empty() ? usual : o_.spp; !rungs.empty()) ladders_.push_back({Ladder::Samples, rungs});
  if (!o_.time.empty()) ladders_.push_back({Ladder::Time, o_.time});
}

SceneChoice Sweep::choiceOf(const std::string& file) const {
  SceneChoice choice = o_.view;
  choice.file = file;
  return choice;
}

std::vector<SweepJob> Sweep::jobsOf(const std::string& scene) const {
  std::vector<SweepJob> jobs;
  for (const LadderRungs& l : ladders_)
    for (int k = 0; k < o_.seeds; ++k)
      for (const std::vector<size_t>& group : groupMethods(methods_, l.ladder == Ladder::Time)) {
        SweepJob job;
        job.ladder = l.ladder;
        job.seed = o_.seed + static_cast<uint64_t>(k);
        SweepRow cell;
        cell.scene = scene;
        cell.ladder = l.ladder;
        cell.seed = job.seed;
        for (size_t i : group) {
          const SweepMethod& method = methods_[i];
          job.buffers |= method.buffers;
          cell.method = method.name;
          for (double rung : l.rungs) {
            cell.mark = rung;
            if (!folder_.table().has(cell)) job.cells.push_back({&method, rung});
          }
        }
        if (!job.cells.empty()) jobs.push_back(std::move(job));
      }
  return jobs;
}

void Sweep::expectWork() {
  for (const std::string& name : names_)
    for (const SweepJob& job : jobsOf(name)) {
      const bool samples = job.ladder == Ladder::Samples;
      progress_.expect(samples ? job.lastMark() * job.passesPerRound() : 0, samples ? 0 : job.lastMark());
    }
}

bool Sweep::renderReference(SweepScene& scene, const std::string& integrator) {
  const auto found = std::find_if(integrators_.begin(), integrators_.end(),
                                  [&](const Integrator* i) { return i->name() == integrator; });
  if (!(*found)->unbiased()) warn(fmt::format("{}: the reference's integrator {} is biased", scene.name, integrator));
  Settings settings = settings_;
  settings.integrators = {integrator};
  settings.spp = o_.referenceSpp;
  const auto total = static_cast<double>(settings.spp);
  progress_.expect(total, 0);
  progress_.begin(scene.name + " reference", total, 0);
  std::optional<SweepReference> reference = braid::renderReference(
      folder_.path("references"), {*scene.scene, scene.camera, settings, integrators_, scene.options},
      [&](const Progress& p) {
        progress_.update(static_cast<double>(p.round), 0, fmt::format("{}/{} spp", p.round, p.rounds));
        return true;
      },
      &interrupted_);
  progress_.end();
  if (!reference) return false;
  scene.reference = std::move(*reference);
  return true;
}

bool Sweep::findReference(SweepScene& scene) {
  const ReferenceFrame frame = referenceFrame(*scene.scene, scene.camera, settings_, scene.options);
  const std::string file = valueForScene(o_.references, scene.name, "");
  std::string integrator = valueForScene(o_.referenceIntegrators, scene.name, "pt");
  if (integrator == "auto") integrator = scene.planned.find("sppm") == std::string::npos ? "pt" : "vcm";
  if (!file.empty()) {
    scene.reference = readReference(file, frame, integrator, o_.seed, static_cast<uint64_t>(o_.seeds));
    const SweepReference& r = scene.reference;
    if (!r.passedOver.empty())
      warn(fmt::format("{}: errors are against {}.mean of {}, not against its {}, whose halves are not independent",
                       scene.name, r.integrator, file, r.passedOver));
    return true;
  }
  std::string stale;
  if (auto kept = keptReference(folder_.path("references"), frame, integrator, o_.referenceSpp, &stale)) {
    scene.reference = std::move(*kept);
    return true;
  }
  if (!stale.empty()) warn(stale);
  return renderReference(scene, integrator);
}

// The first pass pays for memory and caches that every later one finds ready.
void Sweep::warmUp(const SweepScene& scene, const SweepJob& job) const {
  SweepJob once = job;
  once.ladder = Ladder::Samples;
  for (SweepJob::Cell& c : once.cells) c.mark = 1;
  Settings settings = settings_;
  settings.integrators.clear();
  for (const MethodShare& s : once.inputs()) settings.integrators.push_back(s.integrator);
  settings.spp = 1;
  Session(*scene.scene, makePlan(*scene.scene, scene.camera, settings, integrators_)).run({}, &interrupted_);
}

SweepCallbacks Sweep::callbacksOf(const SweepScene& scene, const SweepJob& job) {
  const bool samples = job.ladder == Ladder::Samples;
  SweepCallbacks callbacks;
  callbacks.cancel = &interrupted_;
  callbacks.onRow = [this](const SweepRow& row, const Rgb<float>& image) {
    const auto ladder =
        std::find_if(ladders_.begin(), ladders_.end(), [&](const LadderRungs& l) { return l.ladder == row.ladder; });
    folder_.keep(row, image, row.mark == ladder->rungs.back());
  };
  callbacks.onSkip = [this, &scene](const SweepMethod& method, const std::string& skipReason) {
    warn(fmt::format("{}: {} did not run: {}", scene.name, method.name, skipReason));
    skipReasons_[method.name] = skipReason;
  };
  callbacks.onFailure = [this](const SweepRow& row, const std::string& skipReason) {
    failures_.push_back(fmt::format("{}, {} at {} {}, seed {}: {}", row.scene, row.method, row.mark,
                                    row.ladder == Ladder::Samples ? "samples" : "seconds", row.seed, skipReason));
    warn(failures_.back());
    skipReasons_[row.method] = skipReason;
  };
  callbacks.onRound = [this, &job, samples](uint64_t rounds, double done) {
    const std::string detail = samples ? fmt::format("{}/{} spp", rounds, job.lastMark())
                                       : fmt::format("{:.1f}/{} s, {} spp", done, job.lastMark(), rounds);
    progress_.update(samples ? static_cast<double>(rounds) * job.passesPerRound() : 0, samples ? 0 : done, detail);
  };
  return callbacks;
}

bool Sweep::runJob(const SweepScene& scene, const SweepJob& job) {
  const bool samples = job.ladder == Ladder::Samples;
  const double passes = samples ? job.lastMark() * job.passesPerRound() : 0, seconds = samples ? 0 : job.lastMark();
  std::string who;
  for (const MethodShare& i : job.inputs()) who += (who.empty() ? "" : "+") + i.integrator;
  progress_.begin(fmt::format("{} {} seed {}", scene.name, who, job.seed), passes, seconds);
  const bool completed = runSweepJob(scene, settings_, integrators_, measurement_, job, callbacksOf(scene, job));
  progress_.end();
  return completed && !interrupted_;
}

void Sweep::warnAboutReference(const SweepScene& scene) {
  if (!scene.reference.image.hasHalves()) {
    warn(
        fmt::format("{}: the reference has no halves: relL2_unbiased stays empty, and the reference's noise is part "
                    "of every error",
                    scene.name));
    return;
  }
  const double noise = referenceNoise(scene.reference.image);
  const SweepTable& table = folder_.table();
  const size_t column = table.column("relL2_unbiased");
  double least = INFINITY;
  for (const SweepRow& r : table.rows)
    if (r.scene == scene.name) least = std::min(least, r.values[column]);
  if (std::isfinite(least) && noise > 0.1 * std::max(0.0, least))
    warn(
        fmt::format("{}: the reference's own noise (relL2 {}) is over a tenth of the smallest error ({}): raise "
                    "--reference-spp, or read relL2_unbiased only",
                    scene.name, shortNumber(noise), shortNumber(least)));
}

bool Sweep::runScene(size_t index) {
  SweepScene scene;
  scene.name = names_[index];
  scene.file = o_.scenes[index];
  const SceneChoice choice = choiceOf(scene.file);
  OpenedScene opened = openScene(choice);
  scene.loadSeconds = opened.loadSeconds;
  scene.camera = opened.camera;
  scene.scene = std::move(opened.scene);
  scene.options = changedOptions(choice, scene.scene->data());
  scene.planned = plannedIntegrators(scene, settings_, integrators_);
  methods_ = methodsOf_(scene.planned);
  const std::vector<SweepJob> jobs = jobsOf(scene.name);
  if (!findReference(scene)) return false;
  folder_.record(scene, referenceFrame(*scene.scene, scene.camera, settings_, scene.options));
  warmUp(scene, jobs.front());
  for (const SweepJob& job : jobs)
    if (!runJob(scene, job)) return false;
  progress_.breakLine();
  warnAboutReference(scene);
  return true;
}

void Sweep::warn(const std::string& text) {
  progress_.breakLine();
  if (!o_.view.quiet) fmt::print(stderr, "warning: {}\n", text);
}

bool Sweep::reportFailures() const {
  if (!failures_.empty())
    fmt::print(stderr, "{} cells failed and have no rows; the same command tries them again; the last: {}\n",
               failures_.size(), failures_.back());
  bool all = true;
  for (const SweepMethod& method : methods_) {
    const std::vector<SweepRow>& rows = folder_.table().rows;
    const bool ran = std::any_of(rows.begin(), rows.end(), [&](const SweepRow& row) {
      return row.method == method.name && !row.values.empty() && !std::isnan(row.values.front());
    });
    if (ran) continue;
    const auto skipReason = skipReasons_.find(method.name);
    fmt::print(stderr, "{} never ran: {}\n", method.name,
               skipReason == skipReasons_.end() ? "its rows have no values" : skipReason->second);
    all = false;
  }
  return !all || !failures_.empty();
}

int Sweep::run(std::ostream& out) {
  size_t rungs = 0;
  for (const LadderRungs& l : ladders_) rungs += l.rungs.size();
  checkSweepInputs(o_, names_, methods_, integrators_, rungs);
  checkSweepOutputs(o_, names_);
  imageCodecs();  // what cannot be written must not be rendered
  folder_.open(settings_, methods_);
  expectWork();
  bool completed = true;
  for (size_t i = 0; i < names_.size() && completed; ++i)
    if (!jobsOf(names_[i]).empty()) completed = runScene(i);
  progress_.breakLine();
  std::vector<std::string> methods;
  for (const SweepMethod& m : methods_) methods.push_back(m.name);
  folder_.finish(names_, methods, out);
  if (completed) return reportFailures() ? static_cast<int>(ExitCode::BadInput) : 0;
  fmt::print(stderr, "interrupted: the same command goes on where it stopped\n");
  return static_cast<int>(ExitCode::Interrupted);
}

}  // namespace

int runSweep(const SweepOptions& options, const std::vector<SweepMethod>& methods,
             const std::vector<const Integrator*>& integrators, std::ostream& out) {
  return Sweep(
             options, [&](const std::string&) { return methods; }, integrators)
      .run(out);
}

int runSweep(const SweepOptions& options, std::ostream& out) {
  const auto integrators = makeIntegrators();
  const std::vector<const Integrator*> pointers = pointersTo(integrators);
  MethodOptions numbers;
  numbers.set("external-command-timeout", options.commandTimeout);
  const auto methods = [&](const std::string& planned) {
    return sweepMethods(options.methods, pointers, numbers, planned);
  };
  return Sweep(options, methods, pointers).run(out);
}

}  // namespace braid
