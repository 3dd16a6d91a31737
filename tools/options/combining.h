// SPDX-License-Identifier: Apache-2.0
// Denoisers and combiners on the command line: the options that name them, and what their results add to a file.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "combiners/pipeline/pipeline.h"
#include "renderer/film/files/exr.h"
#include "renderer/session/integrator.h"
#include "renderer/session/plan.h"

namespace CLI {
class App;
}

namespace braid {

// What renders combine when nothing is said.
inline constexpr const char* kDefaultMethod = "auto";

struct CombineChoice {
  std::vector<std::string> methods;  // of --combine, the last one is the headline; none: nothing is combined
  bool asked = true;                 // by the user: what is a default only is left out where it cannot run
  std::vector<std::string> denoisers, bases;
  std::string biased;
  bool weights = false;  // also write the maps of weights
  bool helpers = true;   // whether methods get the denoisers that help them
  // Values of method options, in the order of allMethodOptions(); not a number: the default.
  std::vector<double> numbers;

  // All names of methods in it.
  std::vector<std::string> names() const;
  // --combine as it was given.
  std::string text() const;
  PipelineOptions options(const std::atomic<bool>* cancel = nullptr) const;
};

// The names between commas, or nothing for "none".
std::vector<std::string> parseMethods(const std::string& text);

// --denoiser, --biased, --bases, --weights and the options of every registered method.
void addCombineOptions(CLI::App& command, CombineChoice& choice);
// Makes kDefaultMethod the default of a command, before its options are added.
void combineByDefault(CombineChoice& choice);
// After parsing: whether the user named what to combine.
void noteWhoAsked(const CLI::App& command, CombineChoice& choice);
// The steps that will run after a render of so many samples (0: not known); the plan gets what the steps need to be
// kept: quarters, features, history, images for the stop of denoising. Throws Error(Usage) for unknown names.
CombinePlan planCombining(const CombineChoice& choice, uint64_t samples, Plan& plan);

// "+ js: of pt and nfor" or "- curves: needs 3 checkpoints of pt, which has 2", a line for each step.
std::string combinePlanText(const CombinePlan& combinePlan);

// Runs the choice on the estimates; nothing to run is an empty result. `threads` 0: all that the process may use.
PipelineResult runCombining(const Estimates& estimates, const CombineChoice& choice, const PipelineOptions& options,
                            int threads);

// Throws Error(Usage) with a sentence when one of the wanted methods cannot run.
void requireRunnable(const CombinePlan& combinePlan, const std::vector<std::string>& wanted);

// What methods made, in the form that files hold.
class CombinedLayers {
 public:
  // Appends the denoisers' estimates and the header's remarks to `estimates`. `result` must outlive this.
  CombinedLayers(const PipelineResult& result, const std::vector<std::string>& wanted, bool weights, bool timing,
                 Estimates& estimates);
  // combined.<method>, Error and the weights.
  const std::vector<ExrLayer>& layers() const { return list_; }
  // The image of the last wanted method that ran; null: none did.
  const Rgb<float>* headline() const { return headline_; }

 private:
  void add(const std::string& name, const Rgb<float>* image, const Plane<float>* plane);

  std::vector<ExrLayer> list_;
  Plane<float> integratorsError_;
  const Rgb<float>* headline_ = nullptr;
};

// Lines about bad input values and, where they were asked for, methods that did not run.
std::vector<std::string> combineWarnings(const PipelineResult& result, bool asked = true);

}  // namespace braid
