// SPDX-License-Identifier: Apache-2.0
// A coarse picture in the place of one for which --time is too short: when, and its files.
#pragma once

#include <vector>

#include "tools/publish/coarse_render.h"
#include "tools/publish/image_output.h"
#include "tools/run/run_clock.h"

namespace braid {

// Whether a first pass over these pixels may take longer than the limit at all, so that measuring it is worth its time.
bool mayBeTooLate(const PixelWindow& window, int threads, const TimeLimit& limit);

// The same output with what a coarse picture has: the image and its features.
ImageOutput withoutStatistics(const ImageOutput& output);

// Writes the picture enlarged to the plan's window. The header and the first of the warnings say what it is.
// `attributes`: of the header, as far as they do not depend on the passes.
WrittenImage writeCoarse(const CoarseRender& coarse, const Plan& plan, const ImageOutput& output,
                         std::vector<Attribute> attributes, const TimeLimit& limit);

}  // namespace braid
