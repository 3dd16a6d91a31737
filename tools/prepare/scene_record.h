// SPDX-License-Identifier: Apache-2.0
// What a scene holds, for people and programs.
#pragma once

#include <nlohmann/json.hpp>

#include "renderer/scene/scene.h"

namespace braid {

// An object of the keys that `braid info --json` prints; lengths in metres, times in seconds.
nlohmann::json sceneRecord(const Scene& scene);

}  // namespace braid
