// SPDX-License-Identifier: Apache-2.0
// What would fail hours later is refused before the first render.
#pragma once

#include <string>
#include <vector>

#include "tools/sweep/sweep.h"

namespace braid {

// Throws Error where a number, a method, a scene, a reference or an integrator of the options cannot be. `names`: of
// the scenes; `rungs`: of all ladders.
void checkSweepInputs(const SweepOptions& options, const std::vector<std::string>& names,
                      const std::vector<SweepMethod>& methods, const std::vector<const Integrator*>& integrators,
                      size_t rungs);

// What the sweep writes takes the place of no scene and no reference. Throws Error(Usage).
void checkSweepOutputs(const SweepOptions& options, const std::vector<std::string>& names);

}  // namespace braid
