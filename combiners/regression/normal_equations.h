// SPDX-License-Identifier: Apache-2.0
// Solves the small normal equations of one regression model in double, with a ridge that grows until the matrix is
// positive definite.
#pragma once

#include <array>

namespace braid {

struct NormalEquations {
  static constexpr int kMaxSize = 24, kMaxColours = 6;
  int size = 0, colours = 3;                                    // unknowns, and right-hand sides
  std::array<std::array<double, kMaxSize>, kMaxSize> matrix{};  // the lower triangle is read
  std::array<std::array<double, kMaxColours>, kMaxSize> rhs{};
};

struct NormalSolution {
  std::array<std::array<double, NormalEquations::kMaxColours>, NormalEquations::kMaxSize> coefficients{};
  double condition = 0;      // square of the ratio of the extreme Cholesky pivots
  bool raisedRidge = false;  // the ridge had to grow
  bool constant = false;     // not even that helped: the weighted mean rhs_0 / matrix_00, slopes zero
};

// Adds `ridge` to the diagonal, to its first element (the intercept) only on `ridgeIntercept`, and solves by Cholesky.
// On a pivot that is not clearly positive the ridge grows tenfold, up to eight times.
NormalSolution solve(const NormalEquations& equations, double ridge, bool ridgeIntercept);

}  // namespace braid
