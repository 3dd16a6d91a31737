// SPDX-License-Identifier: Apache-2.0
// What denoisers and combiners cost.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "renderer/scene/scene.h"
#include "renderer/session/settings.h"

namespace braid {

// Renders `settings.spp` samples of pt, and of other integrators where a method reads them, and runs the methods
// `repeats` times on the result. For each method, inputs first: its name, the median of its own wall-clock seconds, and
// that per 10⁶ pixels; or why it did not run. Throws Error(Usage) for unknown names.
nlohmann::json benchCombining(const Scene& scene, const CameraData& camera, Settings settings,
                              const std::vector<std::string>& methods, int repeats);

}  // namespace braid
