// SPDX-License-Identifier: Apache-2.0
// The EXR header of a render: everything needed to know what an image is, and nothing that changes between identical
// runs unless asked.
#pragma once

#include <string>
#include <vector>

#include "renderer/film/estimates.h"
#include "renderer/session/session.h"

namespace braid {

// `timing`: also seconds, which differ between runs.
std::vector<Attribute> headerAttributes(const Scene& scene, const Session& session, const RenderResult& result,
                                        const std::string& isa, bool timing);

}  // namespace braid
