// SPDX-License-Identifier: Apache-2.0
// The weights of the double shrinkage estimator (DSCombiner) from squared errors, the method ("double-shrinkage"), and
// what a network may say in the place of its filters ("double-shrinkage-neural"; combiners/README.md, Double
// shrinkage).
#pragma once

#include <functional>
#include <vector>

#include "combiners/method.h"

namespace braid {

// The maximum of the posterior of X given X_u ~ N(X, E_u), X_b ~ N(X, E_b) and the prior X ~ N(X_p, eta²): the mean of
// the three weighted by their precisions, written as two shrinkages (Eqs. 8-10; the printed marginal of X_b has the
// mean X_p, it must be X).
struct DoubleShrinkage {
  double toBiased = 0;  // kappa_1 = E_u / (E_u + E_b): m = kappa_1 X_b + (1 - kappa_1) X_u
  double toPrior = 0;   // kappa_2 = h / (h + eta²): kappa_2 X_p + (1 - kappa_2) m
  double variance = 0;  // of the posterior: h eta² / (h + eta²), with h = E_u E_b / (E_u + E_b)
};

// Squared errors >= 0; an infinite one takes its image out, a zero takes the others out.
DoubleShrinkage doubleShrinkage(double unbiasedError, double biasedError, double priorError);

// E_u, E_b and eta² of every pixel.
struct ShrinkageErrors {
  Plane<float> unbiased, biased, prior;
};

// What a network sees: the images, and the errors as pixels say them, without that of the prior.
struct ErrorImages {
  const Rgb<float>&unbiased, &biased, &prior;
  const ShrinkageErrors& samples;
  const ShrinkageErrors& filtered;  // what double-shrinkage makes of them
};

using ErrorModel = std::function<ShrinkageErrors(const ErrorImages&)>;

// Without a model: double-shrinkage. With one, there is a radiance prior wherever there are halves.
MethodResult runDoubleShrinkage(const MethodInputs& in, const ErrorModel* model);

Needs doubleShrinkageNeeds();
MethodMemory doubleShrinkageMemory(const MemoryCase& of);
// Those that are read with a model as well.
std::vector<OptionInfo> commonDoubleShrinkageOptions();

}  // namespace braid
