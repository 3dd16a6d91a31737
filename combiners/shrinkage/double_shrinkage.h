// SPDX-License-Identifier: Apache-2.0
// The weights of the double shrinkage estimator (DSCombiner) from squared errors (combiners/README.md, Double
// shrinkage).
#pragma once

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

}  // namespace braid
