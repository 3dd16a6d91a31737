// SPDX-License-Identifier: Apache-2.0
// Selection of one base a pixel by its estimated squared error, the baselines of ensembles ("Ensemble Denoising for
// Monte Carlo Renderings", 5.2.6). Three methods differ in what is smoothed, and how: errors or selection.
#pragma once

#include "combiners/ensemble/ensemble_weights.h"
#include "combiners/method.h"

namespace braid {

// The estimated squared errors of the bases, averaged over channels and unfiltered (Eqs. 36 and 37):
//   ½ [(y^A - x^B)² + (y^B - x^A)²] - 2 v - ¼ (y^A - y^B)²,
// where v is the variance of the mean x. Noisy, and often negative.
std::vector<Plane<float>> baseErrors(const Estimate& unbiased, const std::vector<const Estimate*>& bases);

// 1 for the base of the smallest error, the first of equals, and 0 for the others.
WeightMaps selectionMaps(const std::vector<Plane<float>>& errors);

// The cross bilateral filter of Li et al. 2012 ("SURE-based optimization for adaptive sampling and reconstruction"),
// without its colour term: means over 33x33 pixels, clipped at the borders, weighted by
//   exp(-|p - q|² / (2 8²) - Σ_f |f_p - f_q|² / (2 sigma_f² max(s_p + s_q, 0.01)))
// with the features normal, albedo and depth, sigma 0.8, 0.25 and 0.6, and the sample variances s of a feature. Depth
// is divided by its quantile of 99.9 %. `passes` turns variances of the mean into sample variances.
std::vector<Plane<float>> featureFiltered(const std::vector<Plane<float>>& in, const Features* features,
                                          uint64_t passes);

// What all three methods need.
Needs oneHotNeeds();

// The images, error and maps that these weights make of the bases.
MethodResult oneHotResult(const MethodInputs& in, const WeightMaps& weights, const char* method);

}  // namespace braid
