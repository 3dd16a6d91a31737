// SPDX-License-Identifier: Apache-2.0
// The states that `braid render` goes on from, and those that it must not lose.
#pragma once

#include <optional>
#include <string>

#include "renderer/film/film_state.h"
#include "tools/render/render_options.h"

namespace braid {

// The file of the state to go on from; empty: there is none.
std::string resumedFile(const RenderOptions& options);

// Hours of rendering are not replaced because an option was forgotten. Throws Error(Usage).
void protectCheckpoint(const RenderOptions& options);

// The state to go on from, if there is one.
std::optional<FilmState> earlierState(const RenderOptions& options, const Settings& settings);

// Whether the checkpoint of --passes, or of --spp, holds all of them already.
bool holdsAllPasses(const RenderOptions& options);

// What an earlier run kept is kept on, whether or not this one's outputs need it; and samples go where they went,
// unless they are to be placed now.
void keepAsBefore(const FilmState& state, Settings& settings);

}  // namespace braid
