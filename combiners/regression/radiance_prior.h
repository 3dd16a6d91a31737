// SPDX-License-Identifier: Apache-2.0
// The radiance prior X_p of double shrinkage: one local linear model of the features fitted to the unbiased and the
// biased image together, with crossed weights (DSCombiner Section 4.2; combiners/README.md, Radiance prior, which also
// says what is printed wrong in Eq. 17).
#pragma once

#include <array>
#include <vector>

#include "combiners/regression/regression.h"

namespace braid {

// An image, its variance summed over RGB, and its halves.
struct PriorSource {
  const Rgb<float>* image = nullptr;
  const Plane<float>* variance = nullptr;
  const Rgb<float>* half[2] = {nullptr, nullptr};  // of radiancePriorHalves()
};

// `features` are those of the same samples as the images; `fallback` is the zero-order value of every pixel.
// settings.radius is 25 in the paper.
Rgb<float> radiancePrior(const PriorSource& unbiased, const PriorSource& biased,
                         const std::vector<FeatureGroup>& features, const Rgb<float>& fallback,
                         const RegressionSettings& settings, RegressionReport* report = nullptr);

// The priors of both halves by the matrices of the images: weights and features are those of all samples, and only the
// values that are fitted are a half's. As the fit is linear in those, the prior of the images is the mean of the two.
// The noise of a half enters its own weights only crosswise - the unbiased image is weighed by the biased one and the
// other way round - so that residuals across halves stay honest.
std::array<Rgb<float>, 2> radiancePriorHalves(const PriorSource& unbiased, const PriorSource& biased,
                                              const std::vector<FeatureGroup>& features,
                                              const Rgb<float> (&fallback)[2], const RegressionSettings& settings,
                                              RegressionReport* report = nullptr);

}  // namespace braid
