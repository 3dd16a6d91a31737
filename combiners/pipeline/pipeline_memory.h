// SPDX-License-Identifier: Apache-2.0
// What combining takes in memory, from a combine plan alone: for plans, and for limits that are kept before anything
// runs.
#pragma once

#include "combiners/pipeline/combine_plan.h"

namespace braid {

// Bytes a pixel of float planes with these available: estimates, features, and images kept for the stop of denoising.
int estimatesMemory(const AvailableEstimates& available);

// Bytes that runPipeline() takes at the most at a time beside the estimates that it is handed: its own copy of
// what methods read of them, the results so far, and what the method at work needs.
uint64_t pipelineMemory(const CombinePlan& combinePlan, const AvailableEstimates& available, uint64_t pixels,
                        int threads);

}  // namespace braid
