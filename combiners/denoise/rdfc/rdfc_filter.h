// SPDX-License-Identifier: Apache-2.0
// RDFC (Rousselle, Manzi, Zwicker 2013; combiners/README.md, RDFC): three cross bilateral and non-local means filters
// on colour and features, the best one chosen at every pixel by Stein's unbiased risk estimate, and a second pass over
// the result. Constants are those of the authors' program.
#pragma once

#include <atomic>
#include <vector>

#include "combiners/method.h"

namespace braid {

// What is taken for the variance of the mean colour. Shrinking helps where noise is rare and strong, and harms next to
// bright reflections, which lend their variance to pixels around them.
enum class RdfcVariance {
  Sample,    // the estimate's own; the paper's choice for independent samples
  Rescaled,  // that, times the ratio of the variance between halves to it over 21 x 21 pixels; for low-discrepancy ones
  Shrunk     // the estimate's own, shrunk towards its mean over 7 x 7 pixels (regularisedVariance)
};

struct RdfcOptions {
  bool demodulate = false;  // divides the colour by the albedo of the first hit, and multiplies it in the end
  RdfcVariance variance = RdfcVariance::Sample;
  bool secondPass = true;
  bool removeFireflies = false;  // take fireflies out first (fireflies.h)
  GivenQuarters quarters = {};   // that show them; without, the halves do
};

struct RdfcResult {
  Rgb<float> mean, half[2];             // halves where the estimate has them
  Plane<float> risk;                    // blended risk of the candidates, >= 0: the squared error of the first pass
  std::vector<Plane<float>> selection;  // shares of the candidates, sum 1; two without features
};

// The variance that the filter would use: empty where nothing is known of the noise.
Rgb<float> rdfcVariance(const Estimate& estimate, RdfcVariance kind);

// Filters the mean and the halves of an estimate of at least two passes. The halves share all weights and the
// selection: these come from the mean, its variance, the prefiltered features and, in the second pass, the variance
// between the filtered halves. With these given, a half of the result is linear in that half of the colour, but for the
// range that alike pixels about it allow (local_range_clamp.h), and does not see the other one. Features may be null or
// empty; then there is no third candidate. Without halves there is no second pass. Deterministic for any number of
// threads. rdfcVariance() must not be empty.
RdfcResult rdfcDenoised(const Estimate& estimate, const Features* features, const RdfcOptions& options,
                        const std::atomic<bool>* cancel = nullptr);

}  // namespace braid
