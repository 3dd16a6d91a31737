// SPDX-License-Identifier: Apache-2.0
#include "braid/plan_combining.h"

#include <bit>
#include <utility>

#include "renderer/session/integrator.h"

namespace braid {

namespace {

// What is known of an integrator's estimate before the render. Without a limit of rounds there will be enough of them.
AvailableEstimate plannedEstimate(const PlannedIntegrator& p, uint64_t rounds) {
  const uint64_t passes = rounds * static_cast<uint64_t>(p.passesPerRound);
  const int checkpoints = rounds == 0 ? 64 : static_cast<int>(std::bit_width(rounds));  // after the rounds 1, 2, 4, ...
  return {p.integrator->name(),
          p.integrator->unbiased(),
          p.integrator->correlation(),
          passes,
          true,
          true,
          passes == 0 || passes >= 4,
          checkpoints,
          {},
          p.integrator->estimatesBias(),
          p.integrator->separatesDirectLight()};
}

}  // namespace

AvailableEstimates plannedEstimates(const Plan& plan, uint64_t samples) {
  AvailableEstimates available;
  available.features = plan.kept.features;
  for (const PlannedIntegrator& p : plan.integrators) {
    AvailableEstimate e = plannedEstimate(p, samples);
    e.quarters = e.quarters && plan.kept.quarters;
    e.directIndirect = e.directIndirect && plan.kept.directIndirect;
    if (!plan.kept.history) e.checkpoints = 0;
    for (const uint64_t stop : plan.kept.stops)
      if (e.unbiased && (samples == 0 || stop < e.passes)) e.kept.push_back(stop);
    available.estimates.push_back(std::move(e));
  }
  return available;
}

CombinePlan planMethods(const std::vector<std::string>& wanted, const CombinePlanOptions& roles, uint64_t samples,
                        Plan& plan) {
  // By what could be kept, what has to be: quarters and history are of no use elsewhere.
  AvailableEstimates available;
  available.features = true;
  for (const PlannedIntegrator& p : plan.integrators) available.estimates.push_back(plannedEstimate(p, samples));
  CombinePlan combinePlan = makeCombinePlan(available, wanted, roles);
  keepAlso(buffersOf(combinePlan), plan);
  return combinePlan;
}

}  // namespace braid
