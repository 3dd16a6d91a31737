// SPDX-License-Identifier: Apache-2.0
#include "tools/prepare/planned_render.h"

#include <fmt/format.h>

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

}  // namespace

std::string PlannedRender::text() const {
  const std::string left = note.empty() ? "" : fmt::format("- {}\n", note);
  return plan.text() + combinePlanText(combinePlan) + left + memory.text();
}

PlannedRender planRender(const Scene& scene, const CameraData& camera, const Settings& settings,
                         const std::vector<const Integrator*>& integrators, CombineChoice& choice,
                         RenderExtent extent) {
  PlannedRender p;
  const Plan bare = makePlan(scene, camera, settings, integrators);
  p.plan = bare;
  if (extent.resumed && !choice.asked)
    p.combinePlan = makeCombinePlan(plannedEstimates(p.plan, extent.samples), choice.methods, choice.options().roles);
  else
    p.combinePlan = planCombining(choice, extent.samples, p.plan);
  p.memory = planMemory(scene, p.plan, p.combinePlan, settings.spp);
  if (choice.asked || choice.methods.empty()) return p;

  p.note = skipReasonOf(p.combinePlan, choice.methods);
  if (p.note.empty() && p.memory.total() > memoryLimit())
    p.note = fmt::format("{}: takes more memory than the limit allows", choice.text());
  if (!p.note.empty()) {
    choice.methods.clear();
    p.plan = bare;
    p.combinePlan = planCombining(choice, extent.samples, p.plan);  // denoisers may have been named
    p.memory = planMemory(scene, p.plan, p.combinePlan, settings.spp);
  }
  if (extent.goesOn && !extent.resumed) {
    CombineChoice later = choice;
    later.methods = {kDefaultMethod};
    planCombining(later, 0, p.plan);
    p.memory = planMemory(scene, p.plan, p.combinePlan, settings.spp);
  }
  return p;
}

}  // namespace braid
