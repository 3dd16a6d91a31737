// SPDX-License-Identifier: Apache-2.0
// Which errors say where the samples of a render go: those of the image that is made of them.
#pragma once

#include <string>

#include "combiners/pipeline/pipeline.h"
#include "renderer/session/placement_map.h"

namespace braid {

// Who judges for a render whose image these methods make, the last one being the image: Settings::placement.
std::string placementFor(const std::vector<std::string>& methods);

// The errors by that name: "none" those of the samples alone, else those that the method estimates of its image,
// without denoisers that merely help it. Where it makes no image or does not know the error, those of the samples.
RelativeErrors errorsForPlacement(const std::string& placement);

}  // namespace braid
