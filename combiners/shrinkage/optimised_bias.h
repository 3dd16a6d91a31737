// SPDX-License-Identifier: Apache-2.0
// James-Stein's optimised biased image Y*: the unbiased image as a local linear function of the biased image and the
// features, by first-order regression with crossed half buffers (Gu et al. 2022, Section 5.1, Eqs. 10-12;
// combiners/README.md, James-Stein).
#pragma once

#include "combiners/regression/regression.h"
#include "renderer/film/estimates.h"

namespace braid {

struct OptimisedBias {
  // crossed[0] fits X^A to the features and weights of half B, crossed[1] X^B to those of half A; neither is
  // independent of either half. Y* is their mean (alpha = 1/2 in Eq. 12).
  Rgb<float> crossed[2];
  // own[h] fits X^h to the features and weights of half h, so that the halves stay independent of each other: what Y*
  // would be if there were only the samples of that half, up to the cross.
  Rgb<float> own[2];
  double bandwidth = 0;  // kappa: half the mean square of Y^A - Y^B
  RegressionReport report;

  Rgb<float> mean() const;
};

// Both images need halves; features may be null. settings.radius is 25 in the paper. `own` costs little more than
// `crossed`: it shares its matrices.
OptimisedBias optimisedBias(const Estimate& unbiased, const Estimate& biased, const Features* features,
                            const RegressionSettings& settings);

}  // namespace braid
