// SPDX-License-Identifier: Apache-2.0
// From the sums of a pilot's passes to what a choice of integrators reads of them.
#pragma once

#include <vector>

#include "renderer/film/film.h"
#include "renderer/session/mixture/mixture.h"

namespace braid {

// For each block of 4 x 4 pixels, row by row, 1 / its squared brightness: of the mean of all images, with a tenth of
// the frame's so that black blocks do not decide. 0 where nothing is seen.
std::vector<float> blockScales(const std::vector<const Accumulator*>& images);

// Mean, variance of one pass and squared bias of the mean, relative by blockScales(); the bias times `biasScale`.
std::vector<PilotBlock> blocksOf(const Accumulator& sums, bool lowDiscrepancy, const std::vector<float>& scales,
                                 double biasScale);

}  // namespace braid
