// SPDX-License-Identifier: Apache-2.0
// The cross bilateral filter for maps of weights ("Ensemble Denoising for Monte Carlo Renderings", 4.2, Eqs. 32 and
// 33): errors of denoised images vary slowly, weights solved pixel by pixel do not.
#pragma once

#include "combiners/ensemble/ensemble_weights.h"

namespace braid {

// Replaces every map by its mean over 15x15 pixels, clipped at the borders, weighted by
//   exp(-|p - q|² / (2 3²) - D² / (2 2²) - |albedo_p - albedo_q|² / (2 0.25²) - |normal_p - normal_q|² / (2 0.15²)),
//   D² = |z_p - z_q|² / (V_p + V_q + eps),   V = Σ_rgb (z^A - z^B)² / 2.
// `guide` is the image z combined with the raw weights, and its halves. V is the variance of a half, as in the paper;
// eps = 10⁻¹⁰ + 10⁻⁶ |z|². The features may be absent. Means of weights on the simplex stay on it.
// Of the neighbours only those at multiples of `step` pixels in x and y, at most 7: all that differ where blocks of as
// many pixels share their weights.
WeightMaps filteredWeights(const WeightMaps& raw, const Estimate& guide, const Features* features, int step = 1);

}  // namespace braid
