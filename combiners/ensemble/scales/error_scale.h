// SPDX-License-Identifier: Apache-2.0
// The brightness that the errors of several candidates are relative to, as far as it can be known from few samples.
#pragma once

#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

// 1 / sqrt(level² + 0.01) for every pixel, with level the larger of
//   the candidates' own brightness there, averaged by logarithms over the candidates, and
//   the brightness about it: the smaller of the 3x3 mean and the geometric mean over 9x9 pixels of their mean.
// relL2 divides by the true brightness. By the noisy pixel's, or by one candidate's, fireflies would decide; by a mean
// over surroundings alone, what leaks from a lamp into the dark beside it would hardly count; by a pixel's own alone,
// what a candidate left of a firefly would. Images of all samples have seen those that judge: they are bright where
// these have met light, which would then count little, so that images without it won. Hence it is only what both
// halves show: the smaller of their levels in the pixel, or of their 5x5 means and the level of all samples where that
// is more, for beside a lamp chance decides which half a pixel is bright in; and no root exceeds three times that of
// all samples. The candidates are of one size, at least one, finite, and have halves.
Plane<float> commonErrorRoots(const std::vector<const Estimate*>& candidates);

}  // namespace braid
