// SPDX-License-Identifier: Apache-2.0
// What a render must keep for the methods that are to combine it: known before the first sample.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "combiners/pipeline/combine_plan.h"
#include "renderer/session/plan.h"

namespace braid {

// What there will be of the estimates after a render of so many samples (0: not known) by this plan.
AvailableEstimates plannedEstimates(const Plan& plan, uint64_t samples);

// The steps that will run after such a render; the plan gets what they need to be kept: quarters, features, history,
// images for the stop of denoising. Throws Error(Usage) for unknown names.
CombinePlan planMethods(const std::vector<std::string>& wanted, const CombinePlanOptions& roles, uint64_t samples,
                        Plan& plan);

}  // namespace braid
