// SPDX-License-Identifier: Apache-2.0
// What publishing and combining cost a render.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "renderer/scene/scene.h"
#include "renderer/session/settings.h"

namespace braid {

// Renders `settings.spp` samples `repeats` times in turn: the passes and one plain file at their end, and as `render
// -o FILE.exr --combine METHODS` does it, with all that is published on the way and combined at the end (files go to
// the folder for temporary files). Medians of the wall-clock seconds and of the processor seconds of both, what the
// second takes more, as a share of the first; and, as machines are noisy, its own account of that: "share", of its
// seconds, is what was published on the way, the last combining and what its file takes longer to write than the
// plain one. Throws Error(Usage) for unknown names.
nlohmann::json benchPublishing(const Scene& scene, const CameraData& camera, const Settings& settings,
                               const std::vector<std::string>& methods, int repeats);

}  // namespace braid
