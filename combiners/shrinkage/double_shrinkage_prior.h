// SPDX-License-Identifier: Apache-2.0
// The smooth prior that double shrinkage fits to both images (combiners/README.md, Double shrinkage).
#pragma once

#include "combiners/method.h"
#include "combiners/regression/regression.h"

namespace braid {

// What the prior is fitted to beside the biased image, its variance and its squared error.
struct PriorInput {
  const Estimate* x;
  const Rgb<float>* variance;
  Plane<float> error;
};

struct PriorChoice {
  bool optimisedBias = false;  // James-Stein's Y* instead of the radiance prior
  bool ownHalves = true;       // radiance priors of the halves are fitted to their own samples alone
  int stride = 4;              // distance of the models in pixels
};

// Mean and halves. `first` is the first shrinkage: what the prior falls back to.
Estimate doubleShrinkagePrior(const MethodInputs& in, const PriorInput& of, const Estimate& first,
                              const PriorChoice& choice, RegressionReport& report);

}  // namespace braid
