// SPDX-License-Identifier: Apache-2.0
// `braid sweep`: error against samples and time, for scenes × methods × ladder × seeds.
//
// A folder holds a sweep: sweep.csv (a row a cell, added as soon as it is measured), sweep.json (settings, machine,
// build, scenes, summary), references/, images/ (last rung, first seed), plots/ (data, scripts, SVG, PNG), summary.md
// and report.html. Run again with the same settings, it does what is missing: more methods, rungs, seeds or scenes add
// to it.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include "renderer/core/sampler.h"
#include "tools/options/scene_options.h"
#include "tools/sweep/methods/sweep_method.h"

namespace braid {

struct SweepOptions {
  std::vector<std::string> scenes;                      // files
  SceneChoice view;                                     // of every scene: all but its file, size of the frame included
  std::string output;                                   // folder
  std::string preset;                                   // its name, empty: none; already applied
  std::vector<double> spp, time;                        // rungs of the ladders, rising; both empty: 4:256 samples
  std::vector<std::string> methods{"pt", "auto/auto"};  // what renders make when nothing is said, and the plain image
  int seeds = 1;
  uint64_t seed = 0;  // of the first run; the others follow
  uint64_t referenceSpp = 4096;
  // One for all scenes, or SCENE=VALUE with the scene's name (the stem of its file).
  std::vector<std::string> references, referenceIntegrators;
  std::vector<std::string> metrics;  // empty: all
  SamplerKind sampler = SamplerKind::Sobol;
  int maxDepth = 32, threads = 0;
  double cropWorst = 0.001;
  double commandTimeout = 600;  // seconds that one run of an external command may take
  bool noPlots = false;

  SweepOptions() { view.size = {640, 360}; }
};

// The rungs that "FROM:TO" (doubling), "A,B,C" or one number stand for, increasing. With `durations` items may have
// units, as in 30s:4m. Throws Error(Usage).
std::vector<double> parseLadder(const std::string& text, bool durations);

// Names for scenes from their files: the stem, with the folder's name before it where stems repeat, and only letters,
// digits, '.', '_' and '-'.
std::vector<std::string> sceneNames(const std::vector<std::string>& files);

// The value of a list of VALUE and SCENE=VALUE items for one scene; `fallback` where there is none.
std::string valueForScene(const std::vector<std::string>& list, const std::string& scene, const std::string& fallback);

// Runs the sweep with every registered method; the summary goes to `out`. Returns the exit code: 0, 2 when a cell
// failed or a method never ran, or 130 when interrupted, after writing everything that is known. Throws Error.
int runSweep(const SweepOptions& options, std::ostream& out);
// The same for these methods, which `options.methods` is not looked at for, with every scene.
int runSweep(const SweepOptions& options, const std::vector<SweepMethod>& methods,
             const std::vector<const Integrator*>& integrators, std::ostream& out);

}  // namespace braid
