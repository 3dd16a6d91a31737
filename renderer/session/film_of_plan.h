// SPDX-License-Identifier: Apache-2.0
// The film that a plan asks for, and what a pass writes into it.
#pragma once

#include "renderer/film/film_state.h"
#include "renderer/session/plan.h"

namespace braid {

PassPlanes passPlanes(const Plan& plan);

// Accumulators of the plan's integrators without passes. Of 0 x 0 pixels, it still lists what would be summed.
FilmState emptyFilm(const Plan& plan, int width, int height);

// Of the film and of the target of a pass.
uint64_t filmBytesPerPixel(const Plan& plan);

}  // namespace braid
