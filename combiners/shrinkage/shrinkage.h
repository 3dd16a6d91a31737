// SPDX-License-Identifier: Apache-2.0
// The localised positive-part James-Stein combination of an unbiased image X with any other image Y (Gu et al. 2022,
// "Neural James-Stein Combiner for Unbiased and Biased Renderings", Section 4; combiners/README.md, James-Stein).
//
// A block of p = 15 x 15 pixels is pulled towards Y by
//   rho_c = max(0, 1 - c (p - 2) sigma_c² / SSE_c),  SSE_c = Σ (x_i - y_i)²,
// each channel by itself, and a pixel takes the mean factor of the blocks that hold it (Eq. 13):
//   out_i = max(0, y_i + mean(rho_c) (x_i - y_i)).
// The estimator has a lower squared error than X for any Y and any 0 < c < 2; the papers have c = 1.
#pragma once

#include <array>

#include "renderer/core/plane.h"
#include "renderer/film/estimates.h"

namespace braid {

enum class VarianceFilter {
  Box,       // sigma_c² is the mean variance of the very block: a firefly counts alike in sigma² and in SSE
  Gaussian,  // about the centre of the block: a firefly at the rim is in SSE only, and survives
  Robust,    // Σ s² - 2 max s² in place of (p - 2) sigma²: Stein's condition for unequal variances; keeps fireflies
  // Every pixel of the block counts in units of its own variance, Σ (x_i - y_i)² / s_i² against (p - 2): a lamp's
  // mirror image, noisy by itself, no longer hides what is wrong with Y in the quiet pixels around it, and a firefly
  // counts as one pixel. Variances are first averaged with the fourth power of the 7x7 mean of their fourth roots, so
  // that a pixel of no variance does not decide alone.
  Whitened
};

struct JamesSteinSettings {
  int radius = 7;
  double constant = 1.25;
  VarianceFilter filter = VarianceFilter::Box;
  double sigma = 3;          // of the Gaussian, in pixels
  bool positivePart = true;  // off: factors may be negative, as in the original estimator of James and Stein
  bool global = false;       // one factor for the whole image, the original localisation: none
  bool shared = false;       // one factor for the three channels, from the means of their squares and variances
  bool gate = false;         // lone fireflies are replaced by Y first (combiners/README.md, Fireflies)
  bool keepFactors = true;   // off: the result has none
};

// 1 - numerator / SSE, not below 0 on `positivePart`. SSE is not let below 10⁻⁵ (of images of order 1): numerators that
// small do not matter, and 0 / 0 is 1, for X and Y agree.
double shrinkageFactor(double numerator, double sumOfSquares, bool positivePart);

// The variance of most pixels around every one: the fourth power of the 7x7 mean of the fourth roots, to which a few
// fireflies add little.
Plane<float> usualVariance(const Plane<float>& variance);

// What of the noise does not depend on Y: worth keeping when one image is shrunk towards several.
struct NoiseScale {
  std::array<Plane<float>, 3> inverseUnit;  // one over what a squared difference is measured in; empty: 1
  Plane<float> gate;  // of lone fireflies: a mean squared difference below this is theirs, 0 elsewhere; or empty
  // sigma_c² of every block in the place of what the filter makes of the variances; or empty. Not with a unit.
  std::array<Plane<float>, 3> blocks;
};
NoiseScale noiseScale(const Rgb<float>& variance, const JamesSteinSettings& settings);

// Of firefly gates in pixels, where a method has no blocks of its own.
constexpr int kGateRadius = 7;

// Where one sample carries a pixel of an image with this variance of the mean: the least mean squared difference from
// another image that such a pixel contradicts; 0 elsewhere. Compared with windows of (2 radius + 1)² pixels.
Plane<float> fireflyGate(const Rgb<float>& variance, int radius);

// Whether pixel i is a lone firefly of x that does not contradict y and that y is the better for: the mean
// squared difference of its 5x5 neighbours, which is that of y, is not above the variance of pixel i. Neighbours that
// may be fireflies themselves say half of what contradicts y at most. A glossy reflection's pixels stand out by their
// variances, too, and y may be far off in all of them. `gate` is that of the noise of x, or empty.
bool isLoneFirefly(const Plane<float>& gate, const Rgb<float>& x, const Rgb<float>& y, size_t i);

// The mean and the halves of x without its lone fireflies, whose variance is lowered.
Estimate withoutLoneFireflies(const Estimate& x, const Estimate& y, Rgb<float>& variance);

struct ShrunkImage {
  Rgb<float> image;
  Rgb<float> factor;  // mean factor of every pixel and channel: 1 is all X, 0 all Y; or empty
};

// x, y: images; variance: of the mean of x, >= 0. All of one size.
ShrunkImage jamesStein(const Rgb<float>& x, const Rgb<float>& variance, const Rgb<float>& y,
                       const JamesSteinSettings& settings);

// What of X to keep whatever its noise says, by channel (combiners/shrinkage/cross_half_shrinkage.h).
struct LeastFactors {
  std::array<Plane<float>, 3> blocks;     // the factors of blocks are not below it
  std::array<Plane<float>, 3> fireflies;  // the factor of lone fireflies; or empty: they are replaced
};

// The same with the scale of these settings and this variance. `least` may be null: 0. It must be null for one factor
// for the whole image.
ShrunkImage jamesStein(const Rgb<float>& x, const Rgb<float>& variance, const NoiseScale& scale, const Rgb<float>& y,
                       const JamesSteinSettings& settings, const LeastFactors* least = nullptr);

}  // namespace braid
