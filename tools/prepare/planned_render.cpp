// SPDX-License-Identifier: Apache-2.0
#include "tools/prepare/planned_render.h"

#include <algorithm>

#include <fmt/format.h>

#include "braid/place_samples.h"
#include "braid/plan_combining.h"
#include "tools/options/memory_limit.h"

namespace braid {

namespace {

// What keeps the first of the wanted methods that cannot run from it; empty: nothing.
std::string skipReasonOf(const CombinePlan& combinePlan, const std::vector<std::string>& wanted) {
  for (const std::string& name : wanted)
    if (const Step* step = combinePlan.find(name); step && !step->skipReason.empty())
      return fmt::format("{}: {}", name, step->skipReason);
  return "";
}

// Of few samples, whose image is often published on the way: networks help it that the last one does not need.
constexpr uint64_t kEarlySamples = 16;

std::vector<CombinePlan> combinePlansOf(const PlannedRender& p, const CombineChoice& choice) {
  return {p.combinePlan,
          makeCombinePlan(plannedEstimates(p.plan, kEarlySamples), choice.methods, choice.options().roles)};
}

std::string helpersOf(const std::vector<CombinePlan>& combinePlans) {
  std::vector<std::string> names;
  for (const CombinePlan& combinePlan : combinePlans)
    for (const Step& step : combinePlan.steps)
      if (step.helper && step.skipReason.empty() && !std::count(names.begin(), names.end(), step.name))
        names.push_back(step.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

std::string PlannedRender::text() const {
  std::string left;
  for (const std::string& line :
       {without.empty() ? "" : fmt::format("{}: takes more memory than the limit allows", without), note})
    if (!line.empty()) left += fmt::format("- {}\n", line);
  return plan.text() + combinePlanText(combinePlan) + left + memory.text();
}

PlannedRender planRender(const Scene& scene, const CameraData& camera, const Settings& settings,
                         const std::vector<const Integrator*>& integrators, CombineChoice& choice,
                         RenderExtent extent) {
  PlannedRender p;
  Plan bare = makePlan(scene, camera, settings, integrators);
  const auto planAgain = [&] {
    p.plan = bare;
    if (extent.resumed && !choice.asked && !choice.methods.empty())
      p.combinePlan = makeCombinePlan(plannedEstimates(p.plan, extent.samples), choice.methods, choice.options().roles);
    else
      p.combinePlan = planCombining(choice, extent.samples, p.plan);
    p.memory = planMemory(scene, p.plan, combinePlansOf(p, choice), settings.spp);
  };
  planAgain();
  if (p.memory.total() > memoryLimit())
    if (p.without = helpersOf(combinePlansOf(p, choice)); !p.without.empty()) {
      choice.helpers = false;
      planAgain();
    }
  if (choice.asked || choice.methods.empty()) return p;

  p.note = skipReasonOf(p.combinePlan, choice.methods);
  if (p.note.empty() && p.memory.total() > memoryLimit())
    p.note = fmt::format("{}: takes more memory than the limit allows", choice.text());
  if (!p.note.empty()) {
    choice.methods.clear();
    p.without.clear();
    if (!extent.resumed && bare.placesSamples) bare.settings.placement = placementFor(choice.methods);
    planAgain();  // denoisers may have been named
  }
  if (extent.goesOn && !extent.resumed) {
    CombineChoice later = choice;
    later.methods = {kDefaultMethod};
    planCombining(later, 0, p.plan);
    p.memory = planMemory(scene, p.plan, combinePlansOf(p, choice), settings.spp);
  }
  return p;
}

}  // namespace braid
