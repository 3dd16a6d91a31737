// SPDX-License-Identifier: Apache-2.0
// The variance that filters test differences against.
//
// A sample variance of few passes is itself so noisy that a test based on it fails where it came out too small, at
// worst zero where a rare light was never hit. It is shrunk towards its neighbourhood, as an empirical Bayes estimate
// with a prior worth 16 degrees of freedom.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// The number of passes behind an estimate; 16 is assumed of images that do not say.
inline uint64_t passesOf(const Estimate& estimate) { return estimate.passes > 0 ? estimate.passes : 16; }

// ((n - 1) V + 16 box(V)) / (n + 15) with V the variance of the mean, n the passes and box the mean over 7 x 7 pixels
// clipped at the borders. For fewer than four passes, or when V is not known, the box of (A - B)² n_A n_B / n², which
// has the same expectation; empty for a single pass and where there are no halves either. Finite, >= 0, in the units of
// mean²; the variance of a half is twice that.
//
// `robust`: the fourth power of the box of V^¼ in place of the box of V. A few pixels that are much noisier than the
// others, such as the mirror image of a lamp, then lend them none of their variance, with which a filter would take the
// lamp for noise; but where noise is rare and strong, pixels that it has not hit yet look more certain than they are.
Rgb<float> regularisedVariance(const Estimate& estimate, bool robust = false);

}  // namespace braid
