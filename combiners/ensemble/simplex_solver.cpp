// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble/simplex_solver.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/window.h"

namespace braid {

namespace {

constexpr size_t kMostSteps = 1024;  // as in the paper
constexpr double kFlat = 1e-12;      // of the scale: a curvature below it decides nothing
constexpr double kMostWeight = 8;    // of weights that may be negative

}  // namespace

SimplexSolver::SimplexSolver(size_t n, bool nonNegative, double improvement)
    : n_(n),
      nonNegative_(nonNegative),
      improvement_(improvement),
      matrix_(n * n * kLanes),
      weights_(n * kLanes),
      products_(n * kLanes) {}

// The upper triangle, and the scale.
void SimplexSolver::completeMatrix() {
  std::fill_n(scale_, kLanes, 0.0);
  for (size_t i = 0; i < n_; ++i) {
    for (size_t j = 0; j < i; ++j) std::copy_n(entry(i, j), kLanes, entry(j, i));
    for (int l = 0; l < kLanes; ++l) scale_[l] = std::max(scale_[l], std::fabs(entry(i, i)[l]));
  }
}

void SimplexSolver::multiply() {
  std::fill(products_.begin(), products_.end(), 0.0);
  std::fill_n(value_, kLanes, 0.0);
  for (size_t i = 0; i < n_; ++i) {
    double* product = products_.data() + i * kLanes;
    for (size_t j = 0; j < n_; ++j) {
      const double *m = entry(i, j), *w = weight(j);
      for (int l = 0; l < kLanes; ++l) product[l] += m[l] * w[l];
    }
    for (int l = 0; l < kLanes; ++l) value_[l] += product[l] * weight(i)[l];
  }
}

// The exact minimum along w + alpha (e_i - w). Along a line of negative curvature it is the better end.
void SimplexSolver::searchLine(size_t i) {
  double alpha[kLanes];
  const double *w = weight(i), *product = products_.data() + i * kLanes, *diagonal = entry(i, i);
  const double least = nonNegative_ ? 0.0 : -kMostWeight, most = nonNegative_ ? 1.0 : kMostWeight;
  for (int l = 0; l < kLanes; ++l) {
    const double slope = value_[l] - product[l], curvature = value_[l] - 2 * product[l] + diagonal[l];
    const double room = 1 - w[l], tiny = kFlat * scale_[l];
    // The ends: w_i + alpha (1 - w_i) within its range. From vertex i itself there is no line.
    const double inverse = room > 1e-12 ? 1 / room : 0.0;
    const double low = (least - w[l]) * inverse, high = (most - w[l]) * inverse;
    const double best = std::min(std::max(slope / (curvature > tiny ? curvature : 1.0), low), high);
    const double end = curvature * (high * high - low * low) < 2 * slope * (high - low) ? high : low;
    alpha[l] = curvature > tiny ? best : curvature < -tiny ? end : 0.0;
    alpha[l] = room > 1e-12 ? alpha[l] : 0.0;
    value_[l] += alpha[l] * (alpha[l] * curvature - 2 * slope);
  }
  for (size_t j = 0; j < n_; ++j) {
    double *wj = weights_.data() + j * kLanes, *pj = products_.data() + j * kLanes;
    const double *m = entry(i, j), target = j == i ? 1.0 : 0.0;
    for (int l = 0; l < kLanes; ++l) {
      const double moved = (1 - alpha[l]) * wj[l] + alpha[l] * target;
      wj[l] = std::min(std::max(moved, least), most);
      pj[l] = (1 - alpha[l]) * pj[l] + alpha[l] * m[l];
    }
  }
}

bool SimplexSolver::converged() const {
  bool done = true;
  for (int l = 0; l < kLanes; ++l) done = done && before_[l] - value_[l] <= improvement_ * scale_[l];
  return done;
}

// The minimum of curvature w² - 2 slope w + M_11, of which w_0 = w and w_1 = 1 - w are the weights.
void SimplexSolver::solveTwo() {
  const double *m00 = entry(0, 0), *m01 = entry(0, 1), *m11 = entry(1, 1);
  const double high = nonNegative_ ? 1.0 : kMostWeight, low = 1 - high;
  double *w0 = weights_.data(), *w1 = w0 + kLanes;
  for (int l = 0; l < kLanes; ++l) {
    const double slope = m11[l] - m01[l], curvature = m00[l] - 2 * m01[l] + m11[l], tiny = kFlat * scale_[l];
    const double best = std::min(std::max(slope / (curvature > tiny ? curvature : 1.0), low), high);
    const double end = curvature * (high + low) < 2 * slope ? high : low;
    w0[l] = curvature > tiny ? best : curvature < -tiny ? end : 0.5;
    w1[l] = 1 - w0[l];
  }
}

void SimplexSolver::solve() {
  runVectorised([&] {
    completeMatrix();
    if (n_ == 2) return solveTwo();
    std::fill(weights_.begin(), weights_.end(), 1.0 / static_cast<double>(n_));
    multiply();
    for (size_t steps = 0; steps < kMostSteps; steps += n_) {
      std::copy_n(value_, kLanes, before_);
      for (size_t i = 0; i < n_; ++i) searchLine(i);
      if (converged()) break;
      multiply();  // anew, so that rounding does not add up
    }
  });
}

}  // namespace braid
