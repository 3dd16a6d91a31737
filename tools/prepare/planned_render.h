// SPDX-License-Identifier: Apache-2.0
// What a render will do: passes, combiners and memory. What the user asked for has to be possible; combining that is
// only the default is left out where it cannot run or does not fit.
#pragma once

#include <string>
#include <vector>

#include "tools/options/combining.h"
#include "tools/prepare/memory_plan.h"

namespace braid {

struct PlannedRender {
  Plan plan;
  CombinePlan combinePlan;  // what is kept for combiners, and their skipReasons
  MemoryPlan memory;
  std::string note;     // why the default is not combined; empty: it is, or nobody asked
  std::string without;  // helpers that the limit of memory leaves out, by name; empty: none

  std::string text() const;
};

struct RenderExtent {
  uint64_t samples = 0;  // of the whole image, 0: not known
  bool goesOn = false;   // a share or a checkpoint: more samples will come, and combiners will want what they read
  bool resumed = false;  // a state is there already, and holds what it holds
};

// Where the default is left out, `choice` becomes "none"; where helpers do not fit, it becomes one without them.
PlannedRender planRender(const Scene& scene, const CameraData& camera, const Settings& settings,
                         const std::vector<const Integrator*>& integrators, CombineChoice& choice, RenderExtent extent);

}  // namespace braid
