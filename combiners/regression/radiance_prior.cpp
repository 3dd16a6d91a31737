// SPDX-License-Identifier: Apache-2.0
#include "combiners/regression/radiance_prior.h"

#include "combiners/regression/colour_weights.h"

namespace braid {

namespace {

constexpr float kEpsilon = 0.01f;  // epsilon_1 of Eqs. 12 and 17

struct PriorWeights {
  ColourWeights byBiased, byUnbiased, reconstruction;
  PriorWeights(const PriorSource& unbiased, const PriorSource& biased)
      : byBiased(*biased.image, *biased.variance, kEpsilon, false),
        byUnbiased(*unbiased.image, *unbiased.variance, kEpsilon, false),
        reconstruction(*biased.image, *biased.variance, kEpsilon, true) {}
};

}  // namespace

Rgb<float> radiancePrior(const PriorSource& unbiased, const PriorSource& biased,
                         const std::vector<FeatureGroup>& features, const Rgb<float>& fallback,
                         const RegressionSettings& settings, RegressionReport* report) {
  const PriorWeights weights(unbiased, biased);
  RegressionInputs inputs;
  inputs.features = features;
  inputs.terms = {{unbiased.image, &weights.byBiased}, {biased.image, &weights.byUnbiased}};
  inputs.reconstruction = &weights.reconstruction;
  inputs.fallback = &fallback;
  return regress(inputs, settings, report);
}

std::array<Rgb<float>, 2> radiancePriorHalves(const PriorSource& unbiased, const PriorSource& biased,
                                              const std::vector<FeatureGroup>& features,
                                              const Rgb<float> (&fallback)[2], const RegressionSettings& settings,
                                              RegressionReport* report) {
  const PriorWeights weights(unbiased, biased);
  RegressionInputs inputs;
  inputs.features = features;
  inputs.terms = {{unbiased.half[0], &weights.byBiased, unbiased.half[1]},
                  {biased.half[0], &weights.byUnbiased, biased.half[1]}};
  inputs.reconstruction = &weights.reconstruction;
  inputs.fallback = &fallback[0];
  inputs.secondFallback = &fallback[1];
  return regressTwo(inputs, settings, report);
}

}  // namespace braid
