// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include "braid/braid.h"
#include "braid/plan_combining.h"

namespace braid {

void keepFor(const std::string& method, RenderPlan& plan) {
  planMethods({method}, {}, plan.plan.settings.spp, plan.plan);
}

Combination combine(const Estimates& estimates, const std::string& method, const PipelineOptions& options) {
  PipelineResult result = runPipeline(estimates, {method}, options);
  const auto made = std::find_if(result.outputs.begin(), result.outputs.end(),
                                 [&](const PipelineOutput& out) { return out.step.name == method; });
  BRAID_ASSERT(made != result.outputs.end());
  if (!made->ran()) throw Error(ExitCode::BadInput, method + " cannot run: " + made->step.skipReason);
  Combination c{std::move(*made), {}};
  const char* const names[] = {"R", "G", "B"};
  for (size_t i = 0; i < 3; ++i) c.planes.emplace(names[i], c.result.image.mean[i]);
  if (!c.result.error.empty()) c.planes.emplace("Error.Y", c.result.error);
  return c;
}

}  // namespace braid
