// SPDX-License-Identifier: Apache-2.0
// The solver of ensemble weights against exact solutions, for full and for low ranks.
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "combiners/ensemble/simplex_solver.h"

namespace braid::test_simplex_solver {

namespace {

using Matrix = std::vector<std::vector<double>>;

double quadratic(const Matrix& m, const std::vector<double>& w) {
  double sum = 0;
  for (size_t i = 0; i < w.size(); ++i)
    for (size_t j = 0; j < w.size(); ++j) sum += w[i] * m[i][j] * w[j];
  return sum;
}

// Solves a x = b by elimination with pivoting; false where it is singular.
bool solveLinear(Matrix a, std::vector<double> b, std::vector<double>& x) {
  const size_t n = b.size();
  for (size_t k = 0; k < n; ++k) {
    size_t pivot = k;
    for (size_t i = k + 1; i < n; ++i)
      if (std::fabs(a[i][k]) > std::fabs(a[pivot][k])) pivot = i;
    if (std::fabs(a[pivot][k]) < 1e-9) return false;
    std::swap(a[k], a[pivot]);
    std::swap(b[k], b[pivot]);
    for (size_t i = k + 1; i < n; ++i) {
      const double f = a[i][k] / a[k][k];
      for (size_t j = k; j < n; ++j) a[i][j] -= f * a[k][j];
      b[i] -= f * b[k];
    }
  }
  x.assign(n, 0);
  for (size_t k = n; k-- > 0;) {
    double sum = b[k];
    for (size_t j = k + 1; j < n; ++j) sum -= a[k][j] * x[j];
    x[k] = sum / a[k][k];
  }
  return true;
}

// The minimum of wᵀMw over the simplex: of all subsets of weights that may differ from 0, the best stationary point
// without negative weights. Exact as long as M has full rank.
double exactMinimum(const Matrix& m) {
  const size_t n = m.size();
  double best = 1e300;
  for (size_t subset = 1; subset < (size_t(1) << n); ++subset) {
    std::vector<size_t> active;
    for (size_t i = 0; i < n; ++i)
      if (subset >> i & 1) active.push_back(i);
    const size_t k = active.size();
    Matrix a(k + 1, std::vector<double>(k + 1, 1.0));
    std::vector<double> b(k + 1, 0.0), x;
    a[k][k] = 0;
    b[k] = 1;
    for (size_t i = 0; i < k; ++i)
      for (size_t j = 0; j < k; ++j) a[i][j] = m[active[i]][active[j]];
    if (!solveLinear(a, b, x)) continue;
    std::vector<double> w(n, 0.0);
    bool inside = true;
    for (size_t i = 0; i < k; ++i) {
      w[active[i]] = x[i];
      inside = inside && x[i] >= -1e-12;
    }
    if (inside) best = std::min(best, quadratic(m, w));
  }
  return best;
}

std::vector<double> solved(const Matrix& m, bool nonNegative = true) {
  const size_t n = m.size();
  SimplexSolver solver(n, nonNegative);
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j <= i; ++j) std::fill_n(solver.entry(i, j), SimplexSolver::kLanes, m[i][j]);
  solver.solve();
  std::vector<double> w;
  for (size_t i = 0; i < n; ++i) w.push_back(solver.weight(i)[SimplexSolver::kLanes - 1]);
  return w;
}

double largest(const Matrix& m) {
  double scale = 0;
  for (size_t i = 0; i < m.size(); ++i) scale = std::max(scale, m[i][i]);
  return scale;
}

// A sum of outer products of random errors, of deviations that differ by orders of magnitude, plus a common error.
Matrix randomMatrix(size_t n, int terms, std::mt19937& random) {
  std::normal_distribution<double> gauss;
  std::vector<double> deviation(n);
  for (double& d : deviation) d = std::exp(gauss(random));
  Matrix m(n, std::vector<double>(n, 0.0));
  for (int t = 0; t < terms; ++t) {
    std::vector<double> e(n);
    const double common = gauss(random);
    for (size_t i = 0; i < n; ++i) e[i] = common + deviation[i] * gauss(random);
    for (size_t i = 0; i < n; ++i)
      for (size_t j = 0; j < n; ++j) m[i][j] += e[i] * e[j];
  }
  return m;
}

}  // namespace

TEST_CASE("The solver reaches the exact minimum of two to six denoisers within 1e-6") {
  std::mt19937 random(2);
  double worst = 0;
  for (size_t n = 2; n <= 6; ++n)
    for (int trial = 0; trial < 60; ++trial) {
      const Matrix m = randomMatrix(n, 49, random);
      const std::vector<double> w = solved(m);
      double sum = 0;
      for (const double x : w) {
        CHECK(x >= 0);
        sum += x;
      }
      CHECK(sum == doctest::Approx(1).epsilon(1e-12));
      worst = std::max(worst, (quadratic(m, w) - exactMinimum(m)) / largest(m));
    }
  MESSAGE("worst excess relative to the largest entry: ", worst);
  CHECK(worst < 1e-6);
  CHECK(worst > -1e-9);
}

TEST_CASE("A rank of two, as one pixel has it, leaves nothing to gain either") {
  std::mt19937 random(3);
  for (int trial = 0; trial < 100; ++trial) {
    const Matrix m = randomMatrix(4, 2, random);
    const double reached = quadratic(m, solved(m));
    // Against points of a fine grid on the simplex, for the exact solution is not unique.
    double best = 1e300;
    const int k = 24;
    for (int a = 0; a <= k; ++a)
      for (int b = 0; a + b <= k; ++b)
        for (int c = 0; a + b + c <= k; ++c)
          best =
              std::min(best, quadratic(m, {a / double(k), b / double(k), c / double(k), (k - a - b - c) / double(k)}));
    CHECK(reached <= best + 1e-6 * largest(m));
  }
}

TEST_CASE("Scaling a matrix and adding a constant to it do not change the weights") {
  // Why the constants of the published Eqs. 14, 24 and 25, which are wrong, do no harm.
  std::mt19937 random(4);
  for (int trial = 0; trial < 20; ++trial) {
    Matrix m = randomMatrix(4, 49, random);
    const std::vector<double> w = solved(m);
    Matrix scaled = m, shifted = m;
    for (size_t i = 0; i < 4; ++i)
      for (size_t j = 0; j < 4; ++j) {
        scaled[i][j] *= 1e-12;
        shifted[i][j] += 0.1 * largest(m);
      }
    const std::vector<double> a = solved(scaled), b = solved(shifted);
    for (size_t i = 0; i < 4; ++i) {
      CHECK(a[i] == doctest::Approx(w[i]).epsilon(1e-9));
      CHECK(std::fabs(b[i] - w[i]) < 2e-3);
    }
    CHECK(quadratic(m, b) < quadratic(m, w) + 1e-6 * largest(m));
  }
}

}  // namespace braid::test_simplex_solver
