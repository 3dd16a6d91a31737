// SPDX-License-Identifier: Apache-2.0
// Throughput as ratios within one run. The rays that a render traced are recorded and traced again by bare Embree
// calls; the ratio of the two rates, and the share of the render that Embree's part would take, mean the same on every
// machine.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "renderer/scene/scene.h"
#include "renderer/session/settings.h"

namespace braid {

// Rates of rays, paths and photons, and bytes; medians over the repeats.
nlohmann::json benchRays(const Scene& scene, const CameraData& camera, const Settings& settings, int repeats);

}  // namespace braid
