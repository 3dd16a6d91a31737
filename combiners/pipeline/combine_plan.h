// SPDX-License-Identifier: Apache-2.0
// Decides, from what there is, which denoisers and combiners run on what and in which order: a pure function that a
// plan prints before a render and that the pipeline executes after it. What cannot run says why in one sentence.
//
// Forms of names: combiners/pipeline/method_names.h.
//
// How roles are filled where no user names an estimate: combiners/README.md, How estimates become an image. Names of
// methods go before names of estimates: an image that a file holds from an earlier run of a method is not used.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "combiners/method.h"
#include "combiners/pipeline/available_estimates.h"

namespace braid {

// The choices of a user; empty: by the rules above.
struct CombinePlanOptions {
  std::string unbiased, correlated, biased;
  std::vector<std::string> bases;
  std::vector<std::string> denoisers;  // asked for, in this order
  bool helpers = true;                 // whether methods get their helpers (Needs::helper)
  uint64_t stop = 0;                   // passes after which methods that can stop denoising do; 0: never
};

// One method and its inputs, by name; empty: not used.
struct Step {
  std::string name;
  std::shared_ptr<const Method> method;
  std::string unbiased, biased, correlated;
  std::vector<std::string> bases;
  std::string skipReason;  // why it cannot run, in one sentence; empty: it can
  uint64_t stop = 0;       // passes after which the biased input is not denoised anew; 0: never
  // Passes of the earlier image that a denoiser reads in place of the newest, and whose denoised image a combiner
  // reads; 0: none.
  uint64_t kept = 0;
  bool directIndirect = false;  // whether the method reads the direct light of the unbiased estimate
  std::string note;             // what a user should know although it runs, in one sentence; mostly empty
  bool helper = false;          // nobody named it: its image is for the methods that it helps alone
};

struct CombinePlan {
  std::vector<Step> steps;  // inputs before the methods that read them
  const Step* find(const std::string& name) const;
};

// The steps for the wanted methods and everything that they need. Throws Error(Usage) naming an unknown method and
// those that exist.
CombinePlan makeCombinePlan(const AvailableEstimates& available, const std::vector<std::string>& wanted,
                            const CombinePlanOptions& options);

// What a render must keep for the steps that can run.
KeptBuffers buffersOf(const CombinePlan& combinePlan);

}  // namespace braid
