// SPDX-License-Identifier: Apache-2.0
// The U-Nets whose weights Open Image Denoise publishes: four levels of pooling, and at each, on the way up, what was
// there on the way down.
#pragma once

#include "combiners/learned/network.h"
#include "combiners/learned/tza.h"

namespace braid {

// The large one has two convolutions at each level on the way down as well; weights by their names show which it is.
// Throws Error(BadInput) naming what is missing; graphOf() checks the rest.
Network oidnUnet(WeightTensors weights);

}  // namespace braid
