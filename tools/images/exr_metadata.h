// SPDX-License-Identifier: Apache-2.0
// The EXR header of a render: everything needed to know what an image is, and nothing that changes between identical
// runs unless asked.
#pragma once

#include <string>
#include <vector>

#include "renderer/film/estimates.h"
#include "renderer/session/session.h"

namespace braid {

// Plan::unreachable, where it is not empty.
inline constexpr const char* kUnreachableAttribute = "braid/lightOutOfReach";

// What does not depend on the passes: software, scene, plan, camera.
std::vector<Attribute> planAttributes(const Scene& scene, const Plan& plan, const std::string& isa);

// What does: samples, rejected ones, and what files say of every estimate. `timing`: also seconds, which differ between
// runs; `seconds`: of the pass loops.
std::vector<Attribute> passAttributes(const Estimates& estimates, double seconds, bool timing);

// The estimates of a state with the header of an image file.
Estimates describedEstimates(const FilmState& state, bool quarters, bool timing);
Estimates describedEstimates(const Session& session, bool timing);

// Both, of a render that has ended.
std::vector<Attribute> headerAttributes(const Scene& scene, const Session& session, const RenderResult& result,
                                        const std::string& isa, bool timing);

}  // namespace braid
