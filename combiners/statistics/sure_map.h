// SPDX-License-Identifier: Apache-2.0
// Stein's unbiased risk estimate of a denoised image by one random perturbation (Ramani et al. 2008, "Monte-Carlo
// SURE"), and the filter that makes maps of single pixels usable (Firmino et al., progressive blending by curves).
#pragma once

#include <cstdint>
#include <functional>

#include "renderer/core/plane.h"

namespace braid {

// Of a denoised image, per pixel and channel. Unfiltered: very noisy, and often negative.
struct SureMaps {
  Rgb<float> risk;        // its squared error
  Rgb<float> covariance;  // of its error and that of the noisy image
};

// The risk of f(n), where n has the variance v and f is the denoiser, is
//   (f(n) - n)² - v + 2 q,   q = b (f(n + s b) - f(n - s b)) / (2 s),   b = xi sqrt(v),
// xi standard normal by `seed`, pixel and channel. By Stein's lemma, q is the covariance.
// The perturbation has `step` s times the deviation of the pixel mean, so no factor of variance is needed; the
// antithetic pair removes the even orders of f. The derivative wants a small step: a whole deviation, as is usual for
// networks, doubles the noise, and filters that know the variance take it for texture.
SureMaps sureMaps(const Rgb<float>& noisy, const Rgb<float>& denoised, const Rgb<float>& variance, uint64_t seed,
                  double step, const std::function<Rgb<float>(const Rgb<float>&)>& denoise);

// Width of the Gaussian for the maps, in pixels: 100 clamp(sqrt(V), 10⁻³, 1), where V is the mean of the variances
// without the highest 0.1 %, which fireflies would decide. 0.1, the identity, for converged images; a box above 5.
double sureMapFilterSigma(const Rgb<float>& variance);

// Gaussian over 11x11 pixels, clamped at the borders, its weights normalised to 1.
Plane<float> gaussianFiltered(const Plane<float>& in, double sigma);
Rgb<float> gaussianFiltered(const Rgb<float>& in, double sigma);
// With this sigma it is the plain mean of so many pixels, to 0.3 %.
constexpr double kBoxSigma = 100;
constexpr int kMapWindowPixels = 121;

// Makes the filtered map not negative, per channel: what is negative becomes 0 where the unfiltered map is lower than
// the variance on average, that is where the denoiser helps, and its absolute value otherwise.
void applySignRule(Rgb<float>& filtered, const Rgb<float>& unfiltered, const Rgb<float>& variance);

}  // namespace braid
