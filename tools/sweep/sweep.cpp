// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/sweep.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <tuple>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/images/image_codecs.h"
#include "tools/options/cli.h"
#include "tools/options/file_uses.h"
#include "tools/run/interrupt.h"
#include "tools/sweep/sweep_pipeline.h"
#include "tools/sweep/sweep_progress.h"
#include "tools/sweep/sweep_record.h"
#include "tools/sweep/report/sweep_report.h"
#include "tools/sweep/sweep_run.h"
#include "version.h"

namespace braid {

namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

void makeFolder(const std::string& path) {
  std::error_code failure;
  fs::create_directories(path, failure);
  if (failure) throw Error(ExitCode::OutputFailed, fmt::format("{}: cannot be created: {}", path, failure.message()));
}

// Whether the method or an input of it is the fixed image of a file: external:FILE.
bool readsFile(const std::string& method) {
  const std::string name = "external:";
  for (size_t at = method.find(name); at != std::string::npos; at = method.find(name, at + 1))
    if (at == 0 || std::string("@+/").find(method[at - 1]) != std::string::npos) return true;
  return false;
}

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

  void checkInputs() const;
  void checkOutputs() const;
  void openFolder();
  std::vector<SweepJob> jobsOf(const std::string& scene) const;
  void expectWork();
  // False when interrupted.
  bool runScene(size_t index);
  std::string plannedIntegrators(const SweepScene& scene) const;
  bool findReference(SweepScene& scene);
  bool renderReference(SweepScene& scene, const std::string& integrator);
  void warmUp(const SweepScene& scene, const SweepJob& job) const;
  bool runJob(const SweepScene& scene, const SweepJob& job);
  void keepRow(const SweepRow& row, const Rgb<float>& image);
  void recordScene(const SweepScene& scene);
  void warnAboutReference(const SweepScene& scene);
  void sortRows();
  void finish(std::ostream& out);
  void warn(const std::string& text);
  // Says which cells failed and which methods never ran; whether there were any.
  bool reportFailures() const;

  std::string path(const char* name) const { return o_.output + "/" + name; }

  const SweepOptions& o_;
  MethodsOf methodsOf_;
  std::vector<SweepMethod> methods_;  // of the present scene
  std::vector<const Integrator*> integrators_;
  std::vector<std::string> names_;  // of the scenes
  std::vector<LadderRungs> ladders_;
  Settings settings_;
  Measurement measurement_;
  SweepTable table_;
  Json record_;
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
      progress_(options.quiet),
      interrupted_(installInterruptHandler()) {
  SceneChoice scene;
  scene.size = o_.size;
  SampleChoice samples;
  samples.sampler = o_.sampler;
  samples.maxDepth = o_.maxDepth;
  samples.threads = o_.threads;
  settings_ = makeSettings(scene, samples);
  measurement_.metrics = chooseMetrics(o_.metrics);
  measurement_.cropWorst = o_.cropWorst;
  const std::string spp = o_.spp.empty() && o_.time.empty() ? "4:256" : o_.spp;
  if (!spp.empty()) ladders_.push_back({Ladder::Samples, parseLadder(spp, false)});
  if (!o_.time.empty()) ladders_.push_back({Ladder::Time, parseLadder(o_.time, true)});
}

// Everything that can be known to fail hours later is found before the first render.
void Sweep::checkInputs() const {
  if (o_.seeds < 1) throw Error(ExitCode::Usage, "--seeds: at least 1");
  if (o_.seed >= kReferenceSeed - static_cast<uint64_t>(o_.seeds))
    throw Error(ExitCode::Usage, "--seed: below 2^63; references use the seeds from there on");
  if (!(o_.cropWorst >= 0 && o_.cropWorst < 1))
    throw Error(ExitCode::Usage, "--crop-worst: a fraction of the pixels, from 0 to below 1");
  size_t rungs = 0;
  for (const LadderRungs& l : ladders_) rungs += l.rungs.size();
  for (const SweepMethod& method : methods_)
    if (readsFile(method.name) && (rungs > 1 || o_.scenes.size() > 1))
      throw Error(
          ExitCode::Usage,
          fmt::format("--methods: {}: one image cannot stand for {}: it would be compared everywhere as if it had "
                      "been made there; give one scene and one rung, or external-command:'COMMAND {{color}} "
                      "{{albedo}} {{normal}} {{out}}'",
                      method.name,
                      rungs > 1 ? fmt::format("{} rungs", rungs) : fmt::format("{} scenes", o_.scenes.size())));
  for (const std::string& file : o_.scenes)
    if (!fs::exists(file)) throw Error(ExitCode::BadInput, file + ": no such file");
  for (const auto* list : {&o_.references, &o_.referenceIntegrators})
    for (const std::string& item : *list) {
      const std::string scene = item.substr(0, item.find('='));
      if (item.find('=') != std::string::npos && std::find(names_.begin(), names_.end(), scene) == names_.end())
        throw Error(ExitCode::Usage, fmt::format("'{}': no scene of the sweep is called {}", item, scene));
    }
  for (const std::string& name : names_) {
    const std::string file = valueForScene(o_.references, name, ""),
                      integrator = valueForScene(o_.referenceIntegrators, name, "pt");
    if (!file.empty() && !fs::exists(file)) throw Error(ExitCode::BadInput, file + ": no such reference");
    const bool known =
        integrator == "auto" || std::any_of(integrators_.begin(), integrators_.end(),
                                            [&](const Integrator* i) { return i->name() == integrator; });
    if (!known) throw Error(ExitCode::Usage, fmt::format("--reference-integrator: no integrator '{}'", integrator));
  }
}

// What the sweep writes takes the place of no scene and no reference.
void Sweep::checkOutputs() const {
  FileUses uses;
  for (const char* name : {"sweep.csv", "sweep.json", "summary.md", "report.html"}) uses.output("-o", path(name));
  std::vector<std::string> inputs = o_.scenes;
  for (const std::string& file : o_.scenes) uses.scene(file, "");
  for (const std::string& name : names_)
    if (const std::string file = valueForScene(o_.references, name, ""); !file.empty()) {
      uses.input("a reference", file);
      inputs.push_back(file);
    }
  uses.check();
  for (const std::string& file : inputs)
    for (const char* folder : {"images", "plots"})
      if (isWithin(file, path(folder)))
        throw Error(ExitCode::Usage,
                    fmt::format("-o {}: the sweep writes into {}, where its input {} lies: choose another folder",
                                o_.output, path(folder), file));
}

void Sweep::openFolder() {
  for (const char* folder : {"", "/references", "/images", "/plots"}) makeFolder(o_.output + folder);
  const Json settings = sweepSettings(o_, settings_, measurement_);
  record_ = {{"schema", 1}, {"scenes", Json::array()}};
  if (fs::exists(path("sweep.csv"))) table_ = readSweepTable(path("sweep.csv"));
  // A run that ended before its first row binds nobody.
  if (!table_.rows.empty()) {
    record_ = readRecord(path("sweep.json"));
    requireSameSettings(path("sweep.json"), record_["settings"], settings);
    const Json machine = machineRecord();
    if (record_["machine"] != machine) warn("the rows of this folder were measured on another machine: times differ");
    if (table_.columns != measurement_.columns())
      throw Error(ExitCode::Usage, path("sweep.csv") + ": has other columns; choose another folder (-o)");
  }
  table_.columns = measurement_.columns();
  record_["braid"] = {{"version", BRAID_VERSION}, {"build", BRAID_BUILD_FLAGS}};
  record_["machine"] = machineRecord();
  record_["settings"] = settings;
  Json methods = Json::array();
  for (const SweepMethod& m : methods_) methods.push_back(m.name);
  record_["run"] = {{"methods", methods}, {"spp", o_.spp},   {"time", o_.time},
                    {"seeds", o_.seeds},  {"seed", o_.seed}, {"referenceSpp", o_.referenceSpp}};
  writeText(path("sweep.json"), record_.dump(2) + "\n");
  writeSweepTable(path("sweep.csv"), table_);
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
            if (!table_.has(cell)) job.cells.push_back({&method, rung});
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
      path("references"), *scene.scene, scene.camera, settings, integrators_,
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

std::string Sweep::plannedIntegrators(const SweepScene& scene) const {
  Settings settings = settings_;
  settings.integrators = {"auto"};
  settings.spp = 64;
  std::string names;
  for (const PlannedIntegrator& i : makePlan(*scene.scene, scene.camera, settings, integrators_).integrators)
    names += (names.empty() ? "" : "+") + std::string(i.integrator->name());
  return names;
}

bool Sweep::findReference(SweepScene& scene) {
  const ReferenceFrame frame = referenceFrame(*scene.scene, scene.camera, settings_);
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
  if (auto kept = keptReference(path("references"), frame, integrator, o_.referenceSpp)) {
    scene.reference = std::move(*kept);
    return true;
  }
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

void Sweep::keepRow(const SweepRow& row, const Rgb<float>& image) {
  const auto l =
      std::find_if(ladders_.begin(), ladders_.end(), [&](const LadderRungs& x) { return x.ladder == row.ladder; });
  if (row.mark == l->rungs.back() && !image.empty()) {
    ExrOptions exr;
    exr.floatHeadline = true;
    const std::string path = row.seed == o_.seed
                                 ? imagePath(o_.output, row.scene, row.method, row.ladder, row.mark)
                                 : replicatePath(o_.output, row.scene, row.method, row.ladder, row.mark, row.seed);
    writeExr(path, {}, image, nullptr, exr);
  }
  appendSweepRow(path("sweep.csv"), row);
  table_.rows.push_back(row);
}

bool Sweep::runJob(const SweepScene& scene, const SweepJob& job) {
  const bool samples = job.ladder == Ladder::Samples;
  const double passes = samples ? job.lastMark() * job.passesPerRound() : 0, seconds = samples ? 0 : job.lastMark();
  std::string who;
  for (const MethodShare& i : job.inputs()) who += (who.empty() ? "" : "+") + i.integrator;
  progress_.begin(fmt::format("{} {} seed {}", scene.name, who, job.seed), passes, seconds);
  SweepCallbacks callbacks;
  callbacks.cancel = &interrupted_;
  callbacks.onRow = [&](const SweepRow& row, const Rgb<float>& image) { keepRow(row, image); };
  callbacks.onSkip = [&](const SweepMethod& method, const std::string& skipReason) {
    warn(fmt::format("{}: {} did not run: {}", scene.name, method.name, skipReason));
    skipReasons_[method.name] = skipReason;
  };
  callbacks.onFailure = [&](const SweepRow& row, const std::string& skipReason) {
    failures_.push_back(fmt::format("{}, {} at {} {}, seed {}: {}", row.scene, row.method, row.mark,
                                    row.ladder == Ladder::Samples ? "samples" : "seconds", row.seed, skipReason));
    warn(failures_.back());
    skipReasons_[row.method] = skipReason;
  };
  callbacks.onRound = [&](uint64_t rounds, double done) {
    const std::string detail = samples ? fmt::format("{}/{} spp", rounds, job.lastMark())
                                       : fmt::format("{:.1f}/{} s, {} spp", done, job.lastMark(), rounds);
    progress_.update(samples ? static_cast<double>(rounds) * job.passesPerRound() : 0, samples ? 0 : done, detail);
  };
  const bool completed = runSweepJob(scene, settings_, integrators_, measurement_, job, callbacks);
  progress_.end();
  return completed && !interrupted_;
}

void Sweep::recordScene(const SweepScene& scene) {
  const Json now = sceneRecord(scene, referenceFrame(*scene.scene, scene.camera, settings_));
  for (Json& before : record_["scenes"])
    if (before["name"] == scene.name) {
      requireSameScene(path("sweep.json"), before, now);
      before = now;
      writeText(path("sweep.json"), record_.dump(2) + "\n");
      return;
    }
  record_["scenes"].push_back(now);
  writeText(path("sweep.json"), record_.dump(2) + "\n");
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
  const size_t column = table_.column("relL2_unbiased");
  double least = INFINITY;
  for (const SweepRow& r : table_.rows)
    if (r.scene == scene.name) least = std::min(least, r.values[column]);
  if (std::isfinite(least) && noise > 0.1 * std::max(0.0, least))
    warn(
        fmt::format("{}: the reference's own noise (relL2 {}) is over a tenth of the smallest error ({}): raise "
                    "--reference-spp, or read relL2_unbiased only",
                    scene.name, shortNumber(noise), shortNumber(least)));
}

bool Sweep::runScene(size_t index) {
  SceneChoice choice;
  choice.file = o_.scenes[index];
  choice.isa = o_.isa;
  choice.quiet = o_.quiet;
  choice.size = o_.size;  // of its shape depends what the camera sees
  SweepScene scene;
  scene.name = names_[index];
  scene.file = choice.file;
  LoadTimes times;
  SceneData data = loadScene(choice, &times);
  scene.loadSeconds = times.load;
  scene.camera = chooseCamera(data, choice);
  scene.scene = buildScene(std::move(data), choice, scene.camera);
  scene.planned = plannedIntegrators(scene);
  methods_ = methodsOf_(scene.planned);
  const std::vector<SweepJob> jobs = jobsOf(scene.name);
  if (!findReference(scene)) return false;
  recordScene(scene);
  warmUp(scene, jobs.front());
  for (const SweepJob& job : jobs)
    if (!runJob(scene, job)) return false;
  progress_.breakLine();
  warnAboutReference(scene);
  return true;
}

void Sweep::sortRows() {
  const auto place = [](const std::vector<std::string>& order, const std::string& name) {
    return std::find(order.begin(), order.end(), name) - order.begin();
  };
  std::vector<std::string> methods;
  for (const SweepMethod& m : methods_) methods.push_back(m.name);
  const auto key = [&](const SweepRow& r) {
    return std::tuple(place(names_, r.scene), r.scene, place(methods, r.method), r.method, r.ladder, r.mark, r.seed);
  };
  std::stable_sort(table_.rows.begin(), table_.rows.end(),
                   [&](const SweepRow& a, const SweepRow& b) { return key(a) < key(b); });
}

// Rows of earlier runs, of methods and scenes that this one did not ask for, are part of the summary too.
void Sweep::finish(std::ostream& out) {
  progress_.breakLine();
  sortRows();
  writeSweepTable(path("sweep.csv"), table_);
  if (table_.rows.empty()) return;
  std::vector<std::string> scenes, methods;
  const auto add = [](std::vector<std::string>& list, const std::string& name) {
    if (std::find(list.begin(), list.end(), name) == list.end()) list.push_back(name);
  };
  for (const SweepRow& r : table_.rows) {
    add(scenes, r.scene);
    add(methods, r.method);
  }
  const SweepSummary summary = summarise(table_, scenes, methods);
  record_["metrics"] = Json::array();
  for (const Metric* m : measurement_.metrics)
    record_["metrics"].push_back(
        {{"name", m->name}, {"description", m->description}, {"largerIsBetter", m->largerIsBetter}});
  record_["summary"] = toJson(summary);
  writeText(path("sweep.json"), record_.dump(2) + "\n");
  for (const std::string& line : writeSweepReport(o_.output, table_, summary, record_, !o_.noPlots)) warn(line);
  out << toMarkdown(summary);
  if (!o_.quiet) fmt::print(stderr, "Saved: {} {} {}\n", path("sweep.csv"), path("summary.md"), path("report.html"));
}

void Sweep::warn(const std::string& text) {
  progress_.breakLine();
  if (!o_.quiet) fmt::print(stderr, "warning: {}\n", text);
}

bool Sweep::reportFailures() const {
  if (!failures_.empty())
    fmt::print(stderr, "{} cells failed and have no rows; the same command tries them again; the last: {}\n",
               failures_.size(), failures_.back());
  bool all = true;
  for (const SweepMethod& method : methods_) {
    const bool ran = std::any_of(table_.rows.begin(), table_.rows.end(), [&](const SweepRow& row) {
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
  checkInputs();
  checkOutputs();
  imageCodecs();  // what cannot be written must not be rendered
  openFolder();
  expectWork();
  bool completed = true;
  for (size_t i = 0; i < names_.size() && completed; ++i)
    if (!jobsOf(names_[i]).empty()) completed = runScene(i);
  finish(out);
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
