// SPDX-License-Identifier: Apache-2.0
// One estimate out of an unbiased one and photon maps, for everything that reads an unbiased estimate.
#pragma once

#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

// The mean of `unbiased` and the `biased` estimates, weighted in every pixel by the inverses of their squared errors
// (the first stage of double shrinkage, double_shrinkage.h): the unbiased image's is its variance, a photon map's its
// variance plus its squared bias as it estimates them itself, both smoothed. One weight for all channels. Halves and
// quarters are the same combination of theirs, so what is learnt across halves holds for the result. Biased estimates
// vanish as the unbiased variance falls below their squared bias: the result is consistent. Quarters only if all have
// them.
struct FusedEstimate {
  Estimate
      image;  // its variance holds the squared bias too, as the photon maps' errors do that the weights are made of
  // What is known of its squared error, in two parts. Empty without photon maps, when the image is the unbiased one.
  Rgb<float> noise;  // the variance of a combination of independent images
  // What the photon maps' biases leave in it, averaged over channels: halves share it. Unbiased but noisy, with
  // negative values.
  Plane<float> squaredBias;
};
FusedEstimate fusedEstimate(const Estimate& unbiased, const std::vector<const Estimate*>& biased,
                            const Features* features);

}  // namespace braid
