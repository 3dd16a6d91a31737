// SPDX-License-Identifier: Apache-2.0
#include "combiners/regression/normal_equations.h"

#include <algorithm>
#include <cmath>

namespace braid {

namespace {

using Columns = std::array<std::array<double, NormalEquations::kMaxColours>, NormalEquations::kMaxSize>;
using Matrix = std::array<std::array<double, NormalEquations::kMaxSize>, NormalEquations::kMaxSize>;

// The matrix is summed in float: a pivot below that error says nothing about the data.
constexpr double kSmallestPivot = 1e-7;

// Replaces the lower triangle by its Cholesky factor L, whose diagonal holds 1 / L_kk. False on a pivot that is not
// positive, or lost in rounding.
bool factorise(Matrix& m, int size, double& condition) {
  double least = HUGE_VAL, most = 0;
  for (size_t j = 0; j < static_cast<size_t>(size); ++j) {
    double pivot = m[j][j];
    for (size_t k = 0; k < j; ++k) pivot -= m[j][k] * m[j][k];
    if (!(pivot > kSmallestPivot * m[j][j]) || !std::isfinite(pivot)) return false;
    least = std::min(least, pivot);
    most = std::max(most, pivot);
    const double inverse = 1 / std::sqrt(pivot);
    m[j][j] = inverse;
    for (size_t i = j + 1; i < static_cast<size_t>(size); ++i) {
      double sum = m[i][j];
      for (size_t k = 0; k < j; ++k) sum -= m[i][k] * m[j][k];
      m[i][j] = sum * inverse;
    }
  }
  condition = most / least;
  return true;
}

void substitute(const Matrix& factor, int size, int colours, Columns& x) {
  const auto n = static_cast<size_t>(size), columns = static_cast<size_t>(colours);
  for (size_t i = 0; i < n; ++i)
    for (size_t c = 0; c < columns; ++c) {
      double sum = x[i][c];
      for (size_t k = 0; k < i; ++k) sum -= factor[i][k] * x[k][c];
      x[i][c] = sum * factor[i][i];
    }
  for (size_t i = n; i-- > 0;)
    for (size_t c = 0; c < columns; ++c) {
      double sum = x[i][c];
      for (size_t k = i + 1; k < n; ++k) sum -= factor[k][i] * x[k][c];
      x[i][c] = sum * factor[i][i];
    }
}

bool allFinite(const NormalSolution& solution, int size) {
  for (size_t i = 0; i < static_cast<size_t>(size); ++i)
    for (const double v : solution.coefficients[i])
      if (!std::isfinite(v)) return false;
  return true;
}

}  // namespace

NormalSolution solve(const NormalEquations& equations, double ridge, bool ridgeIntercept) {
  NormalSolution solution;
  const auto size = static_cast<size_t>(equations.size);
  double trace = 0;
  for (size_t i = 0; i < size; ++i) trace += equations.matrix[i][i];
  for (int attempt = 0; attempt <= 8; ++attempt) {
    Matrix factor = equations.matrix;
    for (size_t i = ridgeIntercept ? 0 : 1; i < size; ++i) factor[i][i] += ridge;
    if (factorise(factor, equations.size, solution.condition)) {
      solution.coefficients = equations.rhs;
      substitute(factor, equations.size, equations.colours, solution.coefficients);
      if (allFinite(solution, equations.size)) return solution;
    }
    solution.raisedRidge = true;
    ridge = std::max(ridge * 10, 1e-9 * trace);
  }
  solution.constant = true;
  solution.condition = 0;
  solution.coefficients = {};
  for (size_t c = 0; c < static_cast<size_t>(equations.colours); ++c) {
    const double mean = equations.rhs[0][c] / equations.matrix[0][0];
    solution.coefficients[0][c] = std::isfinite(mean) ? mean : 0;
  }
  return solution;
}

}  // namespace braid
