// SPDX-License-Identifier: Apache-2.0
// Pearson's chi-squared test of a direction sampler against the density it claims.
//
// The sphere is cut where a first batch of samples falls, into cells of about equal probability: narrow lobes get
// narrow cells, and within a cell the density is smooth enough for adaptive Gauss quadrature. A second, independent
// batch is counted. What is not sampled (absorbed light, delta lobes) is a cell of its own with the probability 1 -
// integral, so a density that does not add up is found too.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "renderer/core/hash.h"
#include "renderer/core/vec.h"
#include "renderer/transport/bsdf/warp.h"

namespace braid::test {

// A counter through mix64: fixed seeds, the same numbers everywhere.
class Rng {
 public:
  explicit Rng(uint64_t seed) : state_(mix64(seed + 0x9e3779b97f4a7c15ull)) {}
  float next() { return static_cast<float>(mix64(state_ += 0x9e3779b97f4a7c15ull) >> 40) * 0x1p-24f; }
  Vec2 next2() {
    const float x = next();
    return Vec2(x, next());
  }

 private:
  uint64_t state_;
};

// Q(a, x), the upper regularised incomplete gamma function: series below the mean, Lentz's continued fraction above.
inline double gammaQ(double a, double x) {
  if (x <= 0) return 1;
  const double front = std::exp(a * std::log(x) - x - std::lgamma(a));
  if (x < a + 1) {
    double term = 1 / a, sum = term;
    for (int n = 1; n < 2000 && term > sum * 1e-15; ++n) sum += term *= x / (a + n);
    return 1 - front * sum;
  }
  double b = x + 1 - a, c = 1e300, d = 1 / b, h = d;
  for (int n = 1; n < 2000; ++n) {
    const double an = -n * (n - a);
    b += 2;
    d = 1 / (an * d + b);
    c = b + an / c;
    h *= d * c;
    if (std::fabs(d * c - 1) < 1e-15) break;
  }
  return front * h;
}

// Significance of one of n independent tests so that all together raise a false alarm with probability `overall`
// (Šidák).
inline double sidak(double overall, int n) { return -std::expm1(std::log1p(-overall) / n); }

// Equal-area map between a hemisphere (above or below) and the unit square: Lambert's azimuthal projection and the
// concentric map. Keeps float precision at the pole, where narrow lobes lie.
struct HemisphereChart {
  static Vec3 toDirection(bool above, const Vec2& u) {
    const Vec2 p = squareToDisc(u);
    const float r2 = glm::dot(p, p);
    const Vec2 xy = p * safeSqrt(2 - r2);
    return Vec3(xy, above ? 1 - r2 : r2 - 1);
  }
  static Vec2 toSquare(const Vec3& w) { return discToSquare(Vec2(w.x, w.y) / std::sqrt(1 + std::fabs(w.z))); }
  static constexpr double kSolidAngle = 2 * 3.14159265358979323846;
};

class SphereCells {
 public:
  // About `perCell` of the given directions in each cell.
  SphereCells(const std::vector<Vec3>& directions, size_t perCell) : perCell_(std::max(perCell, 2 * kPerPatch)) {
    for (int half = 0; half < 2; ++half) {
      std::vector<Vec2> points;
      for (const Vec3& w : directions) {
        if ((w.z >= 0) == (half == 0)) points.push_back(HemisphereChart::toSquare(w));
      }
      Patch root;
      root.above = half == 0;
      root_[half] = build(root, kNone, points.begin(), points.end());
    }
  }

  size_t count() const { return count_; }

  size_t find(const Vec3& w) const {
    const Vec2 p = HemisphereChart::toSquare(w);
    size_t n = root_[w.z >= 0 ? 0 : 1];
    while (!nodes_[n].leaf) n = nodes_[n].child[p[nodes_[n].axis] < nodes_[n].split ? 0 : 1];
    return nodes_[n].patch.cell;
  }

  // ∫ over each cell in solid angle; function(Vec3) -> number. `error`: that aimed at, relative to 1 spread over all
  // cells; a cell has about ten patches, whose errors partly cancel.
  template <class Function>
  std::vector<double> integrate(const Function& function, double error = 1e-3) const {
    std::vector<double> result(count_);
    const double tolerance = 0.2 * error / static_cast<double>(count_);
    for (const Node& node : nodes_) {
      if (!node.leaf) continue;
      const Patch& p = node.patch;
      // Large patches with hardly a sample: look closely before believing that they are empty.
      const int forced = !p.sparse ? 0 : p.area() > 0.02 ? 4 : p.area() > 1e-3 ? 2 : 0;
      result[p.cell] += refine(p, gauss(p, function), function, tolerance, forced, 8);
    }
    return result;
  }

 private:
  static constexpr size_t kNone = ~size_t{0}, kPerPatch = 12;
  using Iterator = std::vector<Vec2>::iterator;

  // A rectangle of the chart for quadrature, much finer than the cell of the test that it belongs to.
  struct Patch {
    bool above = true;
    Vec2 lo{0}, hi{1};
    size_t cell = kNone;
    bool sparse = false;
    double area() const { return double(hi.x - lo.x) * double(hi.y - lo.y); }
  };
  struct Node {
    bool leaf = true;
    Patch patch;
    int axis = 0;
    float split = 0;
    size_t child[2] = {0, 0};
  };

  size_t build(Patch patch, size_t cell, Iterator first, Iterator last) {
    const auto count = static_cast<size_t>(last - first);
    if (cell == kNone && count < 2 * perCell_) cell = count_++;
    patch.cell = cell;
    patch.sparse = count < kPerPatch / 3;
    const size_t index = nodes_.size();
    nodes_.emplace_back();
    nodes_[index].patch = patch;
    int axis;
    float split;
    if (count < kPerPatch || !chooseCut(patch, first, last, axis, split)) {
      if (cell == kNone) nodes_[index].patch.cell = count_++;
      return index;
    }
    const Iterator middle = std::partition(first, last, [=](const Vec2& p) { return p[axis] < split; });
    Patch below = patch, above = patch;
    below.hi[axis] = above.lo[axis] = split;
    const size_t left = build(below, cell, first, middle);
    const size_t right = build(above, cell, middle, last);
    Node& node = nodes_[index];
    node.leaf = false;
    node.axis = axis;
    node.split = split;
    node.child[0] = left;
    node.child[1] = right;
    return index;
  }

  static bool chooseCut(const Patch& patch, Iterator first, Iterator last, int& axis, float& split) {
    Vec2 lo(1), hi(0);
    for (Iterator p = first; p != last; ++p) {
      lo = glm::min(lo, *p);
      hi = glm::max(hi, *p);
    }
    // Space around a narrow crowd is cut off in steps: quadrature would overlook a crowd in one corner.
    for (axis = 0; axis < 2; ++axis) {
      const float extent = std::max(hi[axis] - lo[axis], 1e-5f);
      split = hi[axis] + extent;
      if (split + extent < patch.hi[axis]) return true;
      split = lo[axis] - extent;
      if (split - extent > patch.lo[axis]) return true;
    }
    axis = hi.x - lo.x > hi.y - lo.y ? 0 : 1;
    const Iterator middle = first + (last - first) / 2;
    const int a = axis;
    std::nth_element(first, middle, last, [a](const Vec2& p, const Vec2& q) { return p[a] < q[a]; });
    split = (*middle)[axis];
    return split > patch.lo[axis] && split < patch.hi[axis];
  }

  template <class Function>
  static double gauss(const Patch& patch, const Function& function) {
    static constexpr double kX[3] = {0.11270166537925831, 0.5, 0.88729833462074169};
    static constexpr double kW[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    double sum = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const Vec2 t(static_cast<float>(kX[i]), static_cast<float>(kX[j]));
        sum += kW[i] * kW[j] *
               double(function(HemisphereChart::toDirection(patch.above, glm::mix(patch.lo, patch.hi, t))));
      }
    }
    return sum * patch.area() * HemisphereChart::kSolidAngle;
  }

  template <class Function>
  static double refine(const Patch& patch, double coarse, const Function& function, double tolerance, int forced,
                       int depth) {
    const Vec2 mid = 0.5f * (patch.lo + patch.hi);
    Patch quarter[4];
    double fine[4], sum = 0;
    for (int q = 0; q < 4; ++q) {
      quarter[q] = patch;
      ((q & 1) ? quarter[q].lo : quarter[q].hi).x = mid.x;
      ((q & 2) ? quarter[q].lo : quarter[q].hi).y = mid.y;
      sum += fine[q] = gauss(quarter[q], function);
    }
    if (depth == 0 || (forced <= 0 && std::fabs(sum - coarse) <= tolerance)) return sum;
    double result = 0;
    for (int q = 0; q < 4; ++q) {
      result += refine(quarter[q], fine[q], function, 0.5 * tolerance, forced - 1, depth - 1);
    }
    return result;
  }

  std::vector<Node> nodes_;
  size_t perCell_, count_ = 0;
  size_t root_[2];
};

struct ChiSquared {
  double pValue = 1;
  double integral = 0;  // of the density over the sphere
  size_t cells = 0;
};

// sample(Rng&) -> optional<Vec3>: a direction, or nothing; pdf(Vec3) -> density per solid angle.
template <class Sample, class Pdf>
ChiSquared chiSquared(const Sample& sample, const Pdf& pdf, uint64_t seed, size_t count = 60000,
                      size_t cellCount = 150) {
  Rng pilotRng(seed), rng(seed ^ 0x5bd1e995u);
  std::vector<Vec3> pilot;
  const size_t pilots = count / 4;
  for (size_t i = 0; i < pilots; ++i) {
    if (const std::optional<Vec3> w = sample(pilotRng)) pilot.push_back(*w);
  }
  const SphereCells cells(pilot, pilots / cellCount);

  std::vector<double> expected = cells.integrate(pdf), observed(cells.count() + 1);
  ChiSquared result;
  for (const double p : expected) result.integral += p;
  for (double& p : expected) p *= static_cast<double>(count);
  expected.push_back(0);
  expected.back() = std::max(0.0, 1 - result.integral) * static_cast<double>(count);
  for (size_t i = 0; i < count; ++i) {
    const std::optional<Vec3> w = sample(rng);
    observed[w ? cells.find(*w) : observed.size() - 1] += 1;
  }

  // Cells with few expected counts are pooled, smallest first, until the approximation holds.
  std::vector<size_t> order(expected.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return expected[a] < expected[b]; });
  double statistic = 0, pooledObserved = 0, pooledExpected = 0;
  for (size_t i : order) {
    pooledObserved += observed[i];
    pooledExpected += expected[i];
    if (pooledExpected < 10) continue;
    statistic += sqr(pooledObserved - pooledExpected) / pooledExpected;
    pooledObserved = pooledExpected = 0;
    ++result.cells;
  }
  if (result.cells > 1) {
    result.pValue = gammaQ(0.5 * static_cast<double>(result.cells - 1), 0.5 * statistic);
  }
  return result;
}

}  // namespace braid::test
