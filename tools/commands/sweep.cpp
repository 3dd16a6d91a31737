// SPDX-License-Identifier: Apache-2.0
// The command line of `braid sweep`.
#include <iostream>
#include <set>

#include <CLI/CLI.hpp>

#include "tools/options/cli.h"
#include "tools/options/option_checks.h"
#include "tools/sweep/sweep.h"
#include "tools/sweep/sweep_preset.h"
#include "tools/sweep/sweep_reference.h"

namespace braid {

void addSweep(CLI::App& app, Action& action) {
  const auto options = std::make_shared<SweepOptions>();
  SweepOptions& o = *options;
  CLI::App* c = app.add_subcommand("sweep", "Error against samples and time: scenes x methods x ladder x seeds");
  c->add_option("SCENE", o.scenes, "glTF files")->required()->type_name("FILE");
  c->add_option("-o,--output", o.output, "Folder of the sweep; run again to go on or to add to it")
      ->required()
      ->type_name("FOLDER");
  c->add_option("--spp", o.spp, "Ladder of samples per pixel: FROM:TO, doubling, or a list (default 4:256)")
      ->check(readBy([](const std::string& text) { parseLadder(text, false); }))
      ->type_name("LADDER");
  c->add_option("--time", o.time, "Ladder of seconds, for comparisons at equal time: FROM:TO, doubling, or a list")
      ->check(readBy([](const std::string& text) { parseLadder(text, true); }))
      ->type_name("LADDER");
  const auto list = [&](const char* name, std::vector<std::string>& value, const char* text) {
    return c->add_option(name, value, text)->delimiter(',')->allow_extra_args(false)->type_name("NAMES");
  };
  list("--methods", o.methods, "Methods, separated by commas (--list prints them)")->capture_default_str();
  c->add_option("--preset", o.preset,
                "papers: the comparisons of the five papers behind the combiners, but for the options given")
      ->type_name("NAME");
  c->add_option("--seeds", o.seeds, "Runs with different seeds")->capture_default_str()->check(wholeNumber(1, 1000000));
  c->add_option("--seed", o.seed, "Seed of the first run")
      ->capture_default_str()
      ->check(wholeNumber(0, kReferenceSeed - 1));
  c->add_option("--reference-spp", o.referenceSpp, "Samples of the references that are rendered")
      ->capture_default_str()
      ->check(wholeNumber(2, kMostSamples));
  list("--reference", o.references, "Reference image instead, or SCENE=FILE,SCENE=FILE");
  list("--reference-integrator", o.referenceIntegrators,
       "Integrator of the references (default pt), or auto: vcm where the plan keeps photon maps, else pt; SCENE=NAME "
       "overrides it for a scene");
  list("--metric", o.metrics, "Metrics, the one of plots and ratios first (default: all, relL2 first)");
  c->add_option("--size", o.size, "Frame in pixels")
      ->capture_default_str()
      ->check(readBy(parseSize))
      ->type_name("WIDTHxHEIGHT");
  c->add_option("--max-depth", o.maxDepth, "Longest path in segments, the camera's included")
      ->capture_default_str()
      ->check(wholeNumber(1, 1000000));
  c->add_option("--sampler", o.sampler, "sobol or independent")->capture_default_str()->type_name("NAME");
  addThreads(*c, o.threads);
  c->add_option("--crop-worst", o.cropWorst, "Fraction of the pixels, the worst, left out of relL2_trimmed")
      ->capture_default_str()
      ->check(number(0, 1, Ends::MostExcluded));
  c->add_option("--isa", o.isa, "Instruction set for Embree: avx2, avx512, sse4.2, or 'auto'")
      ->capture_default_str()
      ->type_name("NAME");
  c->add_option("--external-command-timeout", o.commandTimeout, "Seconds after which an external command is ended")
      ->capture_default_str()
      ->check(number(0.01, 1e6));
  c->add_flag("--no-plots", o.noPlots, "Do not run gnuplot");
  c->add_flag("-q,--quiet", o.quiet, "Errors only");
  c->footer(
      "Writes sweep.csv, sweep.json, summary.md, report.html, plots/, images/ and references/ into the folder.\n"
      "Examples:\n"
      "  braid sweep scenes/cornell.glb -o out --spp 4:1024 --methods pt --seeds 4\n"
      "  braid sweep scenes/*.glb -o out --time 1:32 --methods pt,bdpt --reference-spp 32768 \\\n"
      "      --reference-integrator pt,pool=bdpt\n"
      "  braid sweep scenes/cornell.glb -o out --spp 8:64 \\\n"
      "      --methods \"pt,external-command:my_denoiser {color} {albedo} {normal} {out}\"\n"
      "  braid sweep --preset papers scenes/*.glb -o papers");
  c->callback([options, c, &action] {
    std::set<std::string> given;
    for (const CLI::Option* option : c->get_options())
      if (option->count() > 0) given.insert(option->get_name());
    if (!options->preset.empty()) applyPreset(options->preset, given, *options);
    action = [options] { return runSweep(*options, std::cout); };
  });
}

}  // namespace braid
