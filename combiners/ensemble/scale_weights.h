// SPDX-License-Identifier: Apache-2.0
// Weights of an ensemble from errors at several scales. The errors that halves show in a window know little from few
// samples and much from many; those of the whole image know much from the first samples on, but nothing of places.
#pragma once

#include "combiners/ensemble/ensemble_weights.h"

namespace braid {

// Minimises wᵀMw with w >= 0 and sum(w) = 1 for blocks of 4x4 pixels (block_errors.h), with errors relative to a common
// brightness (error_scale.h), and smooths the maps along surfaces. M starts as the mean of e_i e_j over the image.
// Windows of about 36, then of about 12 pixels draw it to their own mean m, averaged over both pairings of halves,
//   M <- M + s (m - M),   s = max(0, 1 - N / S).
// S is the squared distance of m to M in how much better one candidate is than another, m_ii - m_jj, over all pairs and
// neighbouring windows; N is what noise makes of it, for every pair the larger of the squared distance of the pairings
// to their mean and 8 (2 / n) r (m_ii + m_jj - 2 m_ij), with n the pixels of a window and r the noise of x
// (pooled_noise.h): pairings agree by chance now and then. So the wider scale is a prior whose weight follows from the
// noise of the narrower one (the positive part of James and Stein), and with many samples windows have the last word.
// One map a candidate, of all channels together. All images have halves; the features may be absent.
WeightMaps scaleWeights(const Estimate& x, const std::vector<const Estimate*>& candidates, const Features* features);

}  // namespace braid
