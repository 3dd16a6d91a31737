// SPDX-License-Identifier: Apache-2.0
// What a run takes in memory, worked out before it begins.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "combiners/pipeline/combine_plan.h"
#include "renderer/scene/scene.h"
#include "renderer/session/plan.h"

namespace braid {

struct MemoryItem {
  std::string use;
  uint64_t bytes = 0;
};

struct MemoryPlan {
  std::vector<MemoryItem> items;  // all held at once when memory is at its peak
  // The peak when nothing is combined before the end: at the end the film makes room for combiners. As much as total()
  // where nothing is combined at all.
  uint64_t combinedOnce = 0;
  uint64_t total() const;
  // "memory: 1018 MiB at most: film 313 MiB, ...": one line, the largest first, nothing for items of less than 0.1 MiB;
  // and combinedOnce, if that is less.
  std::string text() const;
};

// The peak of a render of so many samples (0: not known) whose results are published: the scene, the film, what
// integrators need besides, the copy of the estimates that is published, and combining, by any of the combine plans, or
// writing it.
MemoryPlan planMemory(const Scene& scene, const Plan& plan, const std::vector<CombinePlan>& combinePlans,
                      uint64_t samples);

// Throws Error(OutOfMemory), naming what takes most, when the plan exceeds memoryLimit().
void requireWithinLimit(const MemoryPlan& plan);

}  // namespace braid
