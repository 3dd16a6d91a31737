// SPDX-License-Identifier: Apache-2.0
// The table of integrators, expanded from list.def.
#pragma once

#include <memory>
#include <vector>

#include "renderer/session/integrator.h"

namespace braid {

#define INTEGRATOR(name) std::unique_ptr<Integrator> make_##name();
#include "integrators/list.def"
#undef INTEGRATOR

// One of each, in the order of list.def.
std::vector<std::unique_ptr<Integrator>> makeIntegrators();

// The pointers that makePlan() wants.
std::vector<const Integrator*> pointersTo(const std::vector<std::unique_ptr<Integrator>>& integrators);

}  // namespace braid
