// SPDX-License-Identifier: Apache-2.0
// The covers of the material model.
#pragma once

#include "renderer/transport/bsdf/clearcoat.h"
#include "renderer/transport/bsdf/cover.h"
#include "renderer/transport/bsdf/sheen.h"

namespace braid {

using Covers = CoverList<Sheen, Clearcoat>;

}  // namespace braid
