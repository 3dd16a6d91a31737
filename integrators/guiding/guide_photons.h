// SPDX-License-Identifier: Apache-2.0
// Where light comes from, as light subpaths tell it: what a guide's densities are learned from.
#pragma once

#include <vector>

#include "integrators/guiding/guide_record.h"
#include "renderer/session/plan.h"
#include "renderer/transport/context.h"

namespace braid {

inline constexpr size_t kMostGuidePhotons = size_t(1) << 19;  // 14 MiB

// Photons of light that does not come straight from a light: that is for light sampling to find. Nothing when nothing
// emits. In the order of the subpaths, whatever the number of threads.
std::vector<GuidePhoton> traceGuidePhotons(const TransportContext& context, const Plan& plan);

}  // namespace braid
