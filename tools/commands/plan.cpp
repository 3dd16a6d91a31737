// SPDX-License-Identifier: Apache-2.0
// `braid plan`: what would run, what is left out, and why; or the same render as a job for a farm.
#include <algorithm>
#include <filesystem>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "braid/place_samples.h"
#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/film/files/output_file.h"
#include "renderer/film/files/picture.h"
#include "tools/farm/farm_job.h"
#include "tools/options/cli.h"
#include "tools/options/frames.h"
#include "tools/options/syntax/help.h"
#include "tools/options/syntax/option_checks.h"
#include "tools/options/output_options.h"
#include "tools/publish/image_output.h"
#include "tools/prepare/prepared_render.h"

namespace braid {

namespace {

struct PlanOptions {
  SceneChoice scene;
  FrameChoice frames;
  SampleChoice samples;
  ImageOutput image;
  bool transparent = false, json = false;
  // A job for a farm instead of the plan.
  uint64_t tasks = 0;
  std::optional<FarmFormat> format;
  std::string program, checkpoint;
  double saveSeconds = 0;
  const CLI::Option* saveEvery = nullptr;  // of which the job gets the words
  // The command's own options, to carry on what was given: those of the scene and samples, then those of the image.
  std::vector<const CLI::Option*> renderOptions, imageOptions, frameOptions;
};

// The options of the command that `add` appends to it.
template <class Add>
std::vector<const CLI::Option*> added(CLI::App& command, const Add& add) {
  const std::vector<CLI::Option*> before = command.get_options();
  add();
  std::vector<const CLI::Option*> list;
  for (const CLI::Option* option : command.get_options())
    if (std::find(before.begin(), before.end(), option) == before.end()) list.push_back(option);
  return list;
}

// What the user gave of these options, as he gave it, without the named ones and the scene itself.
void carry(const std::vector<const CLI::Option*>& options, const std::vector<std::string>& without,
           std::vector<FarmOption>& list) {
  for (const CLI::Option* option : options) {
    if (option->count() == 0 || option->get_lnames().empty()) continue;
    const std::string& name = option->get_lnames().front();
    if (std::find(without.begin(), without.end(), name) != without.end()) continue;
    if (option->get_expected_min() == 0)  // a flag
      list.push_back({"--" + name, std::nullopt});
    else
      for (const std::string& value : option->results()) list.push_back({"--" + name, value});
  }
}

// Whatever only the whole render would know to keep, each share is told to, for the merged image's sake.
FarmJob farmJob(const PlanOptions& o, const Settings& planned) {
  FarmJob job;
  job.program = o.program.empty() ? std::filesystem::read_symlink("/proc/self/exe").string() : o.program;
  job.folder = std::filesystem::current_path().string();
  job.scene = o.scene.file;
  job.output = o.image.file;
  job.spp = planned.spp;
  job.tasks = o.tasks;
  job.threads = o.samples.threads;
  carry(o.renderOptions, {"spp", "threads"}, job.render);
  carry(o.frameOptions, {"frames"}, job.render);
  if (o.frames.any()) {
    const FrameRange frames = o.frames.frames();
    job.frames = {frames.first, frames.step, frames.count()};
  }
  carry(o.imageOptions,
        {"output", "png", "tone", "exposure", "aovs", "quarters", "history", "direct-indirect", "float", "layer-prefix",
         "weights", "reproducible"},
        job.render);
  if (o.transparent) job.render.push_back({"--transparent", std::nullopt});
  carry({o.saveEvery}, {}, job.render);
  if (planned.keep.quarters) job.render.push_back({"--quarters", std::nullopt});
  if (planned.keep.directIndirect) job.render.push_back({"--direct-indirect", std::nullopt});
  if (planned.keep.history) job.render.push_back({"--history", std::nullopt});
  job.render.push_back({"--aovs", planned.keep.features ? "features" : "none"});
  carry(o.imageOptions, {"output", "combine", "aovs"}, job.merge);
  job.merge.push_back({"--combine", o.image.combine.text()});
  job.merge.push_back({"--aovs", nameOf(o.image.aovSet())});
  if (!o.checkpoint.empty()) job.merge.push_back({"--checkpoint", o.checkpoint});
  if (o.scene.quiet) job.merge.push_back({"--quiet", std::nullopt});
  return job;
}

void checkJobOptions(const PlanOptions& o) {
  if (o.tasks == 0 && !o.format) return;
  const auto refuse = [](const char* text) { throw Error(ExitCode::Usage, text); };
  if (o.tasks == 0) refuse("--format: give --tasks, the number of shares");
  if (!o.format) refuse("--tasks: give --format slurm, opencue, flamenco or make");
  if (o.json) refuse("--json and --tasks: a job is no JSON");
  if (o.image.file.empty()) refuse("--tasks: name the merged image with -o OUT.exr");
  if (o.image.file == kStandardOutput || o.image.png == kStandardOutput)
    refuse("--tasks: standard output gets the job: give the merged image another name");
  if (o.frames.any() && o.frames.frames().count() > 1)
    for (const std::string& file : {o.image.file, o.image.png, o.checkpoint})
      if (!file.empty() && !holdsFrameNumber(file))
        throw Error(ExitCode::Usage, file + ": frames need a place for their number, such as out_####.exr");
  if (o.samples.seconds > 0) refuse("--time: shares are made of passes, so give --spp alone");
}

void printRecord(const PreparedRender& render, const std::string& file) {
  const PlannedRender& planned = render.planned;
  const Plan& plan = planned.plan;
  nlohmann::json lines = nlohmann::json::array();
  for (const PlanLine& line : plan.lines)
    lines.push_back({{"kept", line.kept}, {"subject", line.subject}, {"reason", line.reason}});
  nlohmann::json combiners = nlohmann::json::array();
  for (const Step& step : planned.combinePlan.steps)
    combiners.push_back({{"kept", step.skipReason.empty()}, {"subject", step.name}, {"reason", step.skipReason}});
  nlohmann::json bytes = {{"filmPerPixel", plan.filmBytesPerPixel}, {"total", planned.memory.total()}};
  for (const MemoryItem& item : planned.memory.items) bytes[item.use] = item.bytes;
  const nlohmann::json record = {
      {"schema", 1},         {"scene", file},          {"traits", render.scene().traits().names()},
      {"plan", lines},       {"combiners", combiners}, {"hash", hexString(plan.hash())},
      {"memoryBytes", bytes}};
  fmt::print("{}\n", record.dump(2));
}

int runPlan(PlanOptions o) {
  checkFrames(o.frames, o.scene.frameTime >= 0);
  checkJobOptions(o);
  o.scene.turntable = o.frames.turntable > 0;
  if (o.frames.plays()) o.scene.frameTime = o.frames.timeOf(o.frames.frames().first);
  if (!o.image.file.empty()) imageFormat(o.image.file);
  Settings settings = makeSettings(o.scene, o.samples);
  settings.keep = o.image.buffers();
  settings.transparent = o.transparent;
  const bool shares = o.tasks > 0;
  if (o.samples.placeSamples && shares)
    throw Error(ExitCode::Usage, "--place-samples: a share does not know the sums of the others: leave out --tasks");
  if (o.samples.placeSamples) settings.placement = placementFor(o.image.combine.methods);
  if (shares) splitPasses(settings.spp, o.tasks);  // wrong numbers before the scene is loaded
  const PreparedRender render =
      prepareRender(o.scene, settings, o.image.combine, {settings.spp, shares || !o.checkpoint.empty()});
  if (shares) {
    requireRunnable(render.planned.combinePlan, o.image.combine.methods);
    fmt::print("{}", farmJobText(farmJob(o, render.planned.plan.settings), *o.format));
  } else if (o.json) {
    printRecord(render, o.scene.file);
  } else {
    fmt::print("{}", render.planned.text());
  }
  return 0;
}

void addJobOptions(CLI::App& command, PlanOptions& o) {
  command.add_option("--tasks", o.tasks, "Print a job of this many shares instead of the plan")
      ->check(wholeNumber(1, 100000));
  addWords(command, "--format", o.format, parseFarmFormat,
           "The farm that the job is for: slurm, opencue, flamenco or make")
      ->type_name("NAME");
  command.add_option("--program", o.program, "The braid that the machines run (default: this one, by its full path)")
      ->type_name("FILE");
  o.saveEvery = addParsed(command, "--save-every", o.saveSeconds, parseDuration,
                          "How often shares save their checkpoints (default: as render)")
                    ->type_name("DURATION");
  command.add_option("--checkpoint", o.checkpoint, "Also write the merged sums as a state, to resume or merge on")
      ->type_name("FILE");
  showFirst(command, "Job for a farm", {"--tasks", "--format", "--program", "--save-every", "--checkpoint"});
}

constexpr const char* kPlanHints =
    "Takes the options of `braid render`. With --tasks and --format, standard output is a job: shares of\n"
    "the passes that go on from their checkpoints when started again, and a merge that waits for them. It\n"
    "runs in the folder where it was printed, which all machines have to share.\n"
    "Examples:\n"
    "  braid plan scene.glb\n"
    "  braid plan scene.glb -o out.exr --spp 4096 --tasks 16 --format slurm > job.sh\n"
    "      bash job.sh --partition=long --time=8:00:00       (options of sbatch)\n"
    "  braid plan scene.glb -o out_####.exr --frames 0:240 --spp 64 --tasks 2 --format make > job.mk\n"
    "      make -j2 -f job.mk\n"
    "  braid plan scene.glb -o out.exr --spp 4096 --tasks 16 --format opencue > job.py\n"
    "      SHOW=testing python3 job.py\n"
    "  braid plan scene.glb -o out.exr --spp 4096 --tasks 16 --format flamenco > braid_out.js";

}  // namespace

void addPlan(CLI::App& app, Action& action) {
  auto options = std::make_shared<PlanOptions>();
  PlanOptions& o = *options;
  o.samples.integrators = {"auto"};
  combineByDefault(o.image.combine);
  CLI::App* command =
      app.add_subcommand("plan", "Print what a render would keep and leave out, and why; or a job for a farm");
  command->footer(kPlanHints);
  o.renderOptions = added(*command, [&] {
    addSceneOptions(*command, o.scene);
    addSampleOptions(*command, o.samples);
    addPlacement(*command, o.samples);
  });
  o.frameOptions = added(*command, [&] { addFrameRangeOptions(*command, o.frames); });
  o.imageOptions = added(*command, [&] { addImageOptions(*command, o.image); });
  command->add_flag("--transparent", o.transparent, "Alpha channel; camera rays that miss add nothing");
  command->add_flag("--json", o.json, "As JSON");
  showFirst(*command, kOutputHelp, {"--transparent", "--json"});
  addJobOptions(*command, o);
  command->callback([options, command, &action] {
    noteWhoAsked(*command, options->image.combine);
    action = [options] { return runPlan(*options); };
  });
}

}  // namespace braid
