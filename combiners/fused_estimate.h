// SPDX-License-Identifier: Apache-2.0
// One estimate out of an unbiased one and photon maps, for everything that reads an unbiased estimate.
#pragma once

#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

// The mean of `unbiased` and the `biased` estimates, weighted in every pixel by the inverses of their squared errors
// (the first stage of double shrinkage, double_shrinkage.h): the unbiased image's is its variance, a photon map's its
// variance plus its squared bias as it estimates them itself, both smoothed. One weight for all channels. Halves and
// quarters are the same combination of theirs, so what is learnt across halves holds for the result; the variance is
// that of a combination of independent images, to which the squared bias is counted. Biased estimates vanish as the
// unbiased variance falls below their squared bias: the result is consistent. Quarters only if all have them.
struct FusedEstimate {
  Estimate image;
  // The part of its squared error that its halves share, averaged over channels: what the photon maps' biases leave in
  // it, as they estimate them. Empty without photon maps, when the image is the unbiased one.
  Plane<float> squaredBias;
};
FusedEstimate fusedEstimate(const Estimate& unbiased, const std::vector<const Estimate*>& biased,
                            const Features* features);

}  // namespace braid
