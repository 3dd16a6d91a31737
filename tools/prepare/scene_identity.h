// SPDX-License-Identifier: Apache-2.0
// What a scene is besides the bytes of its file, for telling states apart.
#pragma once

#include <vector>

#include "renderer/film/film_state.h"
#include "tools/options/scene_options.h"

namespace braid {

// The options that change a scene after it was read; an environment by its pixels. `data` is what loadScene() returned.
std::vector<StateOption> sceneIdentity(const SceneChoice& choice, const SceneData& data);

}  // namespace braid
