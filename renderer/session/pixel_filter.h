// SPDX-License-Identifier: Apache-2.0
// Reconstruction filters by importance sampling: the sample position is drawn from the filter, so a camera sample
// touches one pixel only and every per-pixel variance model stays true (Ernst et al. 2006). Radii in pixels.
#pragma once

#include "renderer/core/vec.h"
#include "renderer/session/settings.h"

namespace braid {

// Maps a uniform variate to an offset from the pixel centre with density proportional to the filter.
float sampleFilter(PixelFilter filter, float u);

const char* toString(PixelFilter filter);

}  // namespace braid
