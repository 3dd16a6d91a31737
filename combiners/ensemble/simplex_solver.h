// SPDX-License-Identifier: Apache-2.0
// Minimises wᵀMw over weights w that sum to 1 and are not negative, for several small problems at once ("Ensemble
// Denoising for Monte Carlo Renderings", 4.1.2): the weights so far are one virtual denoiser, which is combined with
// the real ones in turn, each time with the exact minimum along the line between both,
//   w <- (1 - alpha) w + alpha e_i,   alpha = (wᵀMw - (Mw)_i) / (wᵀMw - 2 (Mw)_i + M_ii),
// which is Eq. (29) where M comes from one pixel. Unlike in the paper the start is 1/N and the order fixed, so that the
// result is a function of M, and a line also goes on beyond w, away from vertex i, until w_i is 0: without that step,
// minima on faces of the simplex are approached in an endless zigzag. Of two denoisers the minimum is known (Eq. 29).
#pragma once

#include <cstddef>
#include <vector>

namespace braid {

class SimplexSolver {
 public:
  static constexpr int kLanes = 16;  // problems at a time

  // For matrices of size n x n, n >= 1. Without nonNegative, weights are only kept within [-8, 8]. The search ends
  // where a cycle through all vertices gains no more than `improvement` of the largest diagonal entry.
  SimplexSolver(size_t n, bool nonNegative, double improvement = 1e-9);

  // Entry (i, j), j <= i, of the matrices of all lanes, to be set before solve(): finite, in any unit. A matrix that is
  // not positive semidefinite leads to a local minimum.
  double* entry(size_t i, size_t j) { return matrix_.data() + (i * n_ + j) * kLanes; }

  void solve();

  // Weight i of all lanes.
  const double* weight(size_t i) const { return weights_.data() + i * kLanes; }

 private:
  void completeMatrix();
  void multiply();
  void searchLine(size_t i);
  void solveTwo();
  bool converged() const;

  size_t n_;
  bool nonNegative_;
  double improvement_;
  std::vector<double> matrix_, weights_, products_;  // M, w and Mw, lanes innermost
  double value_[kLanes] = {}, before_[kLanes] = {};  // wᵀMw now and a cycle ago
  double scale_[kLanes] = {};                        // the largest diagonal entry
};

}  // namespace braid
