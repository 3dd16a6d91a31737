// SPDX-License-Identifier: Apache-2.0
// Whether two images hold the same bits.
#pragma once

#include <string>

#include "renderer/film/files/exr.h"

namespace braid {

// Where the images first differ, as "channel pt.mean.R, pixel 3,4: 0.5 and 0.25" or in size, window or channels; empty
// where every channel of both has the same bits. Values that are not numbers are equal to themselves, 0 is not -0.
std::string firstDifference(const ImageFile& image, const ImageFile& reference);

}  // namespace braid
