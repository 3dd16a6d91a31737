// SPDX-License-Identifier: Apache-2.0
// Squared errors of the images that are shrunk towards one another, estimated from variances, halves and biases
// (combiners/README.md, Double shrinkage; Photon maps).
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// E_u: the variance of the mean, averaged over channels and over 13 x 13 pixels: a box, lest a firefly lend its error
// to too few of its neighbours (combiners/README.md, James-Stein). At least 10⁻⁸ (x² + 10⁻⁴).
Plane<float> unbiasedError(const Estimate& unbiased, const Rgb<float>& variance);

// Raises E_u where the unbiased image is darker than the photon map over a whole window of 13 x 13 pixels: rare paths
// have not been found there, and a variance knows nothing of samples that never came (combiners/README.md, Photon
// maps). The difference D must be beyond 1.1 times the photon map's error E_b, three deviations of the unbiased window
// mean and 1.5 of the photon map's: a firefly of it is about as large as its own deviation, and no light that x lacks.
// Windows are also asked without their largest pixel, whose noise could hide a caustic around it. Errors and noise are
// added as roots, for E_b may be a bias, of which noise takes nothing away. D² - E_b is what E_b does not explain; D²
// would count it twice.
void countMissingLight(Plane<float>& error, const Estimate& unbiased, const Rgb<float>& variance,
                       const Estimate& photonMap, const Plane<float>& photonMapError);

// The square of the bias that an image estimates of itself less the variance of that estimate, averaged over channels:
// unbiased but noisy, with negative values.
Plane<float> squaredBiasSamples(const Estimate& photonMap);

// What the squared error of an image that estimates its own bias is made of (combiners/README.md, Photon maps): its
// variance and gamma², the square of its bias less the variance of that estimate, not below 0. Averaged over channels
// and smoothed over 13 x 13 pixels along surfaces, for bias has structure; where a pixel's own bias is beyond three
// deviations, gamma² is no less than it says. Variances beyond 64 times what is usual around them stay with their
// pixels: a firefly would take a whole window from the photon map, and with it the caustic in it. With an unbiased
// image gamma² is no less than crossHalfSquaredBias().
struct PhotonMapError {
  Plane<float> variance, squaredBias;
};
PhotonMapError photonMapError(const Estimate& photonMap, const Features* features, const Estimate* unbiased = nullptr);
// Their sum, at least 10⁻⁸ (y² + 10⁻⁴).
Plane<float> totalError(const Estimate& photonMap, const PhotonMapError& error);

// E_b: that sum, `measured`: with X as the unbiased image. Without an estimate of the bias, but with halves, the error
// across halves (combiners/README.md, Errors across halves), which holds any bias; else (Y - X)² less the variance,
// which is too small, for Y has seen the samples of X. At least 10⁻⁸ (y² + 10⁻⁴).
Plane<float> biasedError(const Estimate& biased, const Estimate& unbiased, const Rgb<float>& variance,
                         const Features* features, bool measured = false);

// E_b as the pixels say it: of an image that estimates its own bias that variance and that square, else the error
// across halves; averaged over channels, and not below 0.
Plane<float> biasedErrorSamples(const Estimate& biased, const Estimate& unbiased, const Rgb<float>& variance);

// eta²: the squared error of the prior, measured across halves as in half_statistics.h against those of x (the unbiased
// image in the paper), and averaged over 13 x 13 pixels in units of the brightness, sqrt(level² + 0.01): as it is,
// bright pixels would keep the dark ones beside them noisy (combiners/EXPERIMENTS.md, Priors beside photon maps).
// `error` is the squared error of x. Residuals are limited to 8 times the deviation of x around them or, whichever is
// larger, the root mean square of the other residuals: otherwise a prior that is wrong everywhere would keep a weight
// however small the noise. At least 10⁻⁶ (x_p² + 10⁻²), so that a converged image is left alone.
Plane<float> priorError(const Rgb<float>& prior, const Rgb<float> (&halves)[2], const Estimate& x,
                        const Rgb<float>& variance, const Plane<float>& error);

}  // namespace braid
