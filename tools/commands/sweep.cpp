// SPDX-License-Identifier: Apache-2.0
// The command line of `braid sweep`.
#include <iostream>
#include <set>

#include <CLI/CLI.hpp>

#include "tools/options/cli.h"
#include "tools/options/syntax/help.h"
#include "tools/options/syntax/option_checks.h"
#include "tools/options/scene_options.h"
#include "tools/sweep/sweep.h"
#include "tools/sweep/sweep_preset.h"
#include "tools/sweep/sweep_reference.h"

namespace braid {

namespace {

std::vector<double> parseSamples(const std::string& text) { return parseLadder(text, false); }
std::vector<double> parseSeconds(const std::string& text) { return parseLadder(text, true); }

// Items between commas, in one option or several.
CLI::Option* addItems(CLI::App& command, const char* name, std::vector<std::string>& value, const char* text) {
  return command.add_option(name, value, text)->delimiter(',')->allow_extra_args(false)->type_name("NAMES");
}

void addCells(CLI::App& command, SweepOptions& o) {
  command.add_option("SCENE", o.scenes, "glTF files")->required()->type_name("FILE");
  command.add_option("-o,--output", o.output, "Folder of the sweep; run again to go on or to add to it")
      ->required()
      ->type_name("FOLDER");
  addParsed(command, "--spp", o.spp, parseSamples,
            "Ladder of samples per pixel: FROM:TO, doubling, or a list (default 4:256)")
      ->type_name("LADDER");
  addParsed(command, "--time", o.time, parseSeconds,
            "Ladder of seconds, for comparisons at equal time: FROM:TO, doubling, or a list")
      ->type_name("LADDER");
  addItems(command, "--methods", o.methods, "Methods, separated by commas (--list prints them)")->capture_default_str();
  command
      .add_option("--preset", o.preset,
                  "papers: the comparisons of the five papers behind the combiners, but for the options given")
      ->type_name("NAME");
  command.add_option("--seeds", o.seeds, "Runs with different seeds")
      ->capture_default_str()
      ->check(wholeNumber(1, 1000000));
  command.add_option("--seed", o.seed, "Seed of the first run")
      ->capture_default_str()
      ->check(wholeNumber(0, kReferenceSeed - 1));
  showFirst(command, "Cells", {"--output", "--spp", "--time", "--methods", "--preset", "--seeds"});
}

// The same for every scene.
void addView(CLI::App& command, SweepOptions& o) {
  addSize(command, o.view.size);
  addSceneViewOptions(command, o.view);
  showFirst(command, kSceneHelp, {"--size", "--camera", "--look-at", "--env"});
}

void addReferences(CLI::App& command, SweepOptions& o) {
  command.add_option("--reference-spp", o.referenceSpp, "Samples of the references that are rendered")
      ->capture_default_str()
      ->check(wholeNumber(2, kMostSamples));
  addItems(command, "--reference", o.references, "Reference image instead, or SCENE=FILE,SCENE=FILE");
  addItems(command, "--reference-integrator", o.referenceIntegrators,
           "Integrator of the references (default pt), or auto: vcm where the plan keeps photon maps, else pt; "
           "SCENE=NAME overrides it for a scene");
  showFirst(command, "References", {"--reference-spp", "--reference", "--reference-integrator"});
}

void addMeasurements(CLI::App& command, SweepOptions& o) {
  addItems(command, "--metric", o.metrics, "Metrics, the one of plots and ratios first (default: all, relL2 first)");
  command.add_option("--max-depth", o.maxDepth, "Longest path in segments, the camera's included")
      ->capture_default_str()
      ->check(wholeNumber(1, 1000000));
  addSampler(command, o.sampler);
  addThreads(command, o.threads);
  command.add_option("--crop-worst", o.cropWorst, "Fraction of the pixels, the worst, left out of relL2_trimmed")
      ->capture_default_str()
      ->check(number(0, 1, Ends::MostExcluded));
  command
      .add_option("--external-command-timeout", o.commandTimeout, "Seconds after which an external command is ended")
      ->capture_default_str()
      ->check(number(0.01, 1e6));
  command.add_flag("--no-plots", o.noPlots, "Do not run gnuplot");
  command.add_flag("-q,--quiet", o.view.quiet, "Errors only");
  showFirst(command, "Measurement", {"--metric", "--max-depth", "--threads", "--no-plots", "--quiet"});
}

constexpr const char* kSweepHints =
    "Writes sweep.csv, sweep.json, summary.md, report.html, plots/, images/ and references/ into the\n"
    "folder.\n"
    "Examples:\n"
    "  braid sweep scenes/cornell.glb -o out --spp 4:1024 --methods pt --seeds 4\n"
    "  braid sweep scenes/*.glb -o out --time 1:32 --methods pt,bdpt --reference-spp 32768 \\\n"
    "      --reference-integrator pt,pool=bdpt\n"
    "  braid sweep model.glb -o out --env sky.hdr --look-at 0,1,4,0,1,0\n"
    "  braid sweep scenes/cornell.glb -o out --spp 8:64 \\\n"
    "      --methods \"pt,external-command:my_denoiser {color} {albedo} {normal} {out}\"\n"
    "  braid sweep --preset papers scenes/*.glb -o papers";

}  // namespace

void addSweep(CLI::App& app, Action& action) {
  const auto options = std::make_shared<SweepOptions>();
  CLI::App* command = app.add_subcommand("sweep", "Error against samples and time: scenes x methods x ladder x seeds");
  addCells(*command, *options);
  addView(*command, *options);
  addReferences(*command, *options);
  addMeasurements(*command, *options);
  command->footer(kSweepHints);
  command->callback([options, command, &action] {
    std::set<std::string> given;
    for (const CLI::Option* option : command->get_options())
      if (option->count() > 0) given.insert(option->get_name());
    if (!options->preset.empty()) applyPreset(options->preset, given, *options);
    action = [options] { return runSweep(*options, std::cout); };
  });
}

}  // namespace braid
