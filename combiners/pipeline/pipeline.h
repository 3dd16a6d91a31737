// SPDX-License-Identifier: Apache-2.0
// Runs denoisers and combiners on the estimates of a render, in process or from files: inputs are sanitised and
// exposure-normalised once (combiners/pipeline/exposure.h), each denoiser runs once, and results come back in the units
// of the estimates.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "combiners/pipeline/exposure.h"
#include "combiners/pipeline/combine_plan.h"

namespace braid {

// By this option methods that read files learn which factor their inputs were multiplied by.
inline const OptionInfo kPipelineExposure{"pipeline-exposure", 1, "Factor of the exposure normalisation"};

struct PipelineOptions {
  CombinePlanOptions roles;
  MethodOptions numbers;
  // Factor of the exposure normalisation; 0: from the unbiased estimate. A series of checkpoints that is to be compared
  // keeps the first one's.
  double exposure = 0;
  const std::atomic<bool>* cancel = nullptr;  // once set, what is left to run is left out and the result worth nothing
};

// What one method made, or why it made nothing.
struct PipelineOutput {
  Step step;                    // the method, its inputs by name, and the skipReason if it did not run
  MethodResult result;          // in the units of the estimates; image.name is the step's name
  bool failed = false;          // it, or an input of it, was run and failed: that may be otherwise another time
  double seconds = 0;           // of the method itself
  double meanOverUnbiased = 1;  // of the images: what part of the light is left; not a number for a black image
  double inputSeconds = 0;      // of the denoisers and combiners that it reads, each once
  bool ran() const { return step.skipReason.empty(); }
};

struct PipelineResult {
  std::vector<PipelineOutput> outputs;  // in the order in which they ran: inputs first
  double exposure = 1;                  // colours were multiplied by this
  SanitiseReport sanitised;
  const PipelineOutput* find(const std::string& name) const;
};

// Which planes the steps that can run read: no others are copied for them.
PlanesRead planesRead(const CombinePlan& combinePlan);

// Runs the wanted methods and what they need. A denoiser's image becomes an estimate that is not unbiased; its halves
// are the method's own responsibility. The callback that runs a denoiser on another image, for SURE, moves the halves
// and quarters along with the mean, so that the mean stays the mean of the halves. Throws Error(Usage) for unknown
// names; everything else that keeps a method from running is in its output.
PipelineResult runPipeline(const Estimates& estimates, const std::vector<std::string>& wanted,
                           const PipelineOptions& options);

// Names of the inputs, constants, meanOverUnbiased, exposure and seconds of an output, for the header of a file:
// attributes named "braid/<layer name>/…". `timing`: also seconds, which differ between runs.
std::vector<Attribute> remarksOf(const PipelineOutput& output, bool timing);

}  // namespace braid
