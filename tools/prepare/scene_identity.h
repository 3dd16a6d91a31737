// SPDX-License-Identifier: Apache-2.0
// What a scene is besides the bytes of its file, for telling states and references apart.
#pragma once

#include <string>
#include <vector>

#include "renderer/film/film_state.h"
#include "tools/options/scene_options.h"

namespace braid {

// The options that change a scene after it was read; an environment by its pixels. `data` is what loadScene() returned.
std::vector<StateOption> sceneIdentity(const SceneChoice& choice, const SceneData& data);

// Those options and the background where they are not the default ones, as "--env 4x2:0123, --light-scale 2".
std::string changedOptions(const SceneChoice& choice, const SceneData& data);

}  // namespace braid
