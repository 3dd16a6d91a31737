// SPDX-License-Identifier: Apache-2.0
// The choices of a plan that passes depend on, by which states of different renders are told apart.
#pragma once

#include <vector>

#include "renderer/film/film_state.h"
#include "renderer/session/plan.h"

namespace braid {

// Names are those of the command line. Not among them: how many passes, threads, and what is written.
std::vector<StateOption> pixelOptions(const Plan& plan);

}  // namespace braid
