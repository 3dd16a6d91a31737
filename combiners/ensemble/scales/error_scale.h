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
// what a candidate left of a firefly would. The candidates are of one size, at least one, and finite.
Plane<float> commonErrorRoots(const std::vector<const Estimate*>& candidates);

}  // namespace braid
