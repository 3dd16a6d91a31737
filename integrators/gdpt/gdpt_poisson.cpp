// SPDX-License-Identifier: Apache-2.0
// Alternating directions (integrators/README.md, Alternating directions): a step with parameter p solves
//
//   (H + p) u½ = b - (V - p) u,   (V + p) u' = b - (H - p) u½.
//
// Both halves have the form r ← b - r + s T⁻¹ r with T = H + p or V + p, r the right-hand side of the next half: in the
// first, r = b - (V - p) u, so that b - (H - p) u½ = b - (H + p) u½ + 2p u½ = b - r + 2p u½; likewise in the second
// with p + p', p' the next parameter. So only r and b are stored.
#include "integrators/gdpt/gdpt_poisson.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr size_t kLanes = 8;   // lines solved side by side
constexpr int kDoublings = 4;  // 2^4 steps

// The 2^kDoublings best parameters for the spectrum [lo, hi] (Wachspress 1966): by Gauss's transformation the problem
// on [a, b] with 2n parameters is that on [√(ab), (a+b)/2] with n.
std::vector<double> wachspressParameters(double lo, double hi) {
  double a[kDoublings + 1] = {lo}, b[kDoublings + 1] = {hi};
  for (int i = 0; i < kDoublings; ++i) {
    a[i + 1] = std::sqrt(a[i] * b[i]);
    b[i + 1] = 0.5 * (a[i] + b[i]);
  }
  std::vector<double> p{std::sqrt(a[kDoublings] * b[kDoublings])};
  for (int i = kDoublings; i-- > 0;) {
    std::vector<double> finer;
    for (const double w : p) {
      const double larger = w + std::sqrt(std::max(0.0, w * w - a[i] * b[i]));
      finer.push_back(larger);
      finer.push_back(a[i] * b[i] / larger);
    }
    p = std::move(finer);
  }
  return p;
}

// Lines of pixels along one axis: element i of line l lies at i · along + l · across. One of the steps is 1.
struct Lines {
  size_t length, count, along, across;
};

// The values of up to kLanes neighbouring lines, element by element, so that all loops run over lines side by side.
struct LineGroup {
  std::vector<double> value;
  double* operator[](size_t i) { return value.data() + i * kLanes; }
};

// Calls visit(i, l, k) for every element i of the group's line l, k its index in the image, in the order of memory.
template <class Visit>
void forEachElement(const Lines& lines, size_t first, size_t lanes, const Visit& visit) {
  if (lines.across == 1) {
    for (size_t i = 0; i < lines.length; ++i)
      for (size_t l = 0; l < lanes; ++l) visit(i, l, i * lines.along + first + l);
  } else {
    for (size_t l = 0; l < lanes; ++l)
      for (size_t i = 0; i < lines.length; ++i) visit(i, l, (first + l) * lines.across + i);
  }
}

// x ← T⁻¹ x, T = tridiagonal(-1, 2 + shift, -1) with 1 + shift at both ends (shift for a single pixel), by Gaussian
// elimination with the pivots of makePivots().
void solveLines(const std::vector<double>& pivots, LineGroup& x) {
  const size_t n = pivots.size();
  for (size_t l = 0; l < kLanes; ++l) x[0][l] *= pivots[0];
  for (size_t i = 1; i < n; ++i) {
    double* const here = x[i];
    const double* const before = x[i - 1];
    for (size_t l = 0; l < kLanes; ++l) here[l] = (here[l] + before[l]) * pivots[i];
  }
  for (size_t i = n - 1; i-- > 0;) {
    double* const here = x[i];
    const double* const after = x[i + 1];
    for (size_t l = 0; l < kLanes; ++l) here[l] += pivots[i] * after[l];
  }
}

std::vector<double> makePivots(size_t n, double shift) {
  std::vector<double> pivots(n);
  for (size_t i = 0; i < n; ++i) {
    const double neighbours = (i > 0 ? 1 : 0) + (i + 1 < n ? 1 : 0);
    pivots[i] = 1 / (neighbours + shift - (i > 0 ? pivots[i - 1] : 0));
  }
  return pivots;
}

// r ← b - r + scale · T⁻¹ r along one axis, or r ← T⁻¹ r when b is null.
void halfStep(const Lines& lines, double shift, double scale, const double* b, double* r) {
  const std::vector<double> pivots = makePivots(lines.length, shift);
  parallelChunks(lines.count, kLanes, [&](size_t begin, size_t end) {
    thread_local LineGroup x;
    x.value.assign(lines.length * kLanes, 0.0);
    const size_t lanes = end - begin;
    forEachElement(lines, begin, lanes, [&](size_t i, size_t l, size_t k) { x[i][l] = r[k]; });
    solveLines(pivots, x);
    if (b)
      forEachElement(lines, begin, lanes, [&](size_t i, size_t l, size_t k) { r[k] = b[k] - r[k] + scale * x[i][l]; });
    else
      forEachElement(lines, begin, lanes, [&](size_t i, size_t l, size_t k) { r[k] = x[i][l]; });
  });
}

}  // namespace

void solveScreenedPoisson(Plane<double>& rhs, double alpha) {
  const auto width = static_cast<size_t>(rhs.width), height = static_cast<size_t>(rhs.height);
  const Lines rows{width, height, 1, width}, columns{height, width, width, 1};
  const double screen = 0.5 * alpha * alpha;
  const std::vector<double> p = wachspressParameters(screen, screen + 4);
  const PixelBuffer<double> b = rhs.data;
  double* r = rhs.data.data();
  for (size_t k = 0; k < p.size(); ++k) {
    const bool last = k + 1 == p.size();
    halfStep(rows, screen + p[k], 2 * p[k], b.data(), r);
    halfStep(columns, screen + p[k], last ? 0 : p[k] + p[k + 1], last ? nullptr : b.data(), r);
  }
}

}  // namespace braid
