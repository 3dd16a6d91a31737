// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble/scale_weights.h"

#include <algorithm>

#include "combiners/ensemble/scales/block_errors.h"
#include "combiners/ensemble/scales/error_scale.h"
#include "combiners/ensemble/scales/pooled_noise.h"
#include "combiners/ensemble/simplex_solver.h"
#include "combiners/ensemble/weight_bilateral.h"
#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/pixels/plane_mean.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kWindows[] = {4, 1};     // radii in blocks
constexpr double kPooled = 8;          // by which the noise of x counts: the errors of heavy tails are far from normal
constexpr double kImprovement = 1e-5;  // weights to 1e-9 of the error change nothing
constexpr double kCommonNoise = 0.98;  // of the smallest entry of M: mostly the noise of x, which moves no minimum

using PairPlanes = std::vector<Plane<float>>;  // planes of blocks by pairIndex()

double advantage(const PairPlanes& m, size_t i, size_t j, size_t block) {
  return static_cast<double>(m[pairIndex(i, i)][block]) - static_cast<double>(m[pairIndex(j, j)][block]);
}

// d²: how far two candidates are apart.
double distanceOf(const PairPlanes& m, size_t i, size_t j, size_t block) {
  return static_cast<double>(m[pairIndex(i, i)][block]) + static_cast<double>(m[pairIndex(j, j)][block]) -
         2 * static_cast<double>(m[pairIndex(i, j)][block]);
}

// The share s of every window in M.
Plane<float> windowShares(const PairPlanes (&window)[2], const PairPlanes& m, const Plane<float>& pooled,
                          size_t candidates, int radius) {
  const double side = (2 * radius + 1) * kErrorBlock, perPixel = kPooled * 2 / (side * side);
  Plane<float> noise(m[0].width, m[0].height, kUnfilled), distance(m[0].width, m[0].height, kUnfilled);
  parallelChunks(noise.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t k = begin; k < end; ++k) {
      const double pairings = pooled.empty() ? 2 : 1;  // without the other measure this one has to count for both
      const double ofX = pooled.empty() ? 0 : perPixel * static_cast<double>(pooled[k]);
      double n = 0, s = 0;
      for (size_t i = 0; i < candidates; ++i)
        for (size_t j = 0; j < i; ++j) {
          const double a = advantage(window[0], i, j, k), b = advantage(window[1], i, j, k);
          const double between = 0.5 * (a - b), beyond = 0.5 * (a + b) - advantage(m, i, j, k);
          const double apart = 0.5 * (distanceOf(window[0], i, j, k) + distanceOf(window[1], i, j, k));
          n += std::max(pairings * between * between, ofX * apart);
          s += beyond * beyond;
        }
      noise[k] = finiteFloat(n);
      distance[k] = finiteFloat(s);
    }
  });
  noise = boxMean<float>(noise, radius + 1);
  distance = boxMean<float>(distance, radius + 1);
  for (size_t k = 0; k < noise.size(); ++k) {
    const double n = static_cast<double>(noise[k]), s = static_cast<double>(distance[k]);
    distance[k] = s > 0 ? static_cast<float>(std::max(0.0, 1 - n / s)) : 0.0f;
  }
  return distance;
}

// Draws M to the windows of one size.
void drawTo(const PairPlanes (&blocks)[2], const Plane<float>& pooled, size_t candidates, int radius, PairPlanes& m) {
  PairPlanes window[2];
  for (size_t h = 0; h < 2; ++h)
    for (const Plane<float>& plane : blocks[h]) window[h].push_back(boxMean<float>(plane, radius));
  const Plane<float> shares = windowShares(window, m, pooled, candidates, radius);
  parallelFor(m.size(), [&](size_t p) {
    for (size_t k = 0; k < shares.size(); ++k) {
      const double own = 0.5 * (static_cast<double>(window[0][p][k]) + static_cast<double>(window[1][p][k]));
      const double before = static_cast<double>(m[p][k]);
      m[p][k] = finiteFloat(before + static_cast<double>(shares[k]) * (own - before));
    }
  });
}

void fillBlock(Plane<float>& plane, int column, int row, float value) {
  for (int y = row * kErrorBlock; y < std::min(plane.height, (row + 1) * kErrorBlock); ++y)
    for (int x = column * kErrorBlock; x < std::min(plane.width, (column + 1) * kErrorBlock); ++x)
      plane.at(x, y) = value;
}

// M of the blocks from `column` on, without the noise that its entries have in common.
void fillMatrices(const PairPlanes& m, int column, int row, int lanes, SimplexSolver& solver) {
  for (int l = 0; l < SimplexSolver::kLanes; ++l) {
    const size_t at = m[0].index(column + std::min(l, lanes - 1), row);
    double common = static_cast<double>(m[0][at]);
    for (const Plane<float>& plane : m) common = std::min(common, static_cast<double>(plane[at]));
    size_t i = 0, j = 0;
    for (const Plane<float>& plane : m) {
      solver.entry(i, j)[l] = static_cast<double>(plane[at]) - kCommonNoise * common;
      if (++j > i) ++i, j = 0;
    }
  }
}

void solveRow(const PairPlanes& m, int row, WeightMaps& out) {
  SimplexSolver solver(out.bases, true, kImprovement);
  for (int column = 0; column < m[0].width; column += SimplexSolver::kLanes) {
    const int lanes = std::min(SimplexSolver::kLanes, m[0].width - column);
    fillMatrices(m, column, row, lanes, solver);
    solver.solve();
    for (size_t b = 0; b < out.bases; ++b)
      for (int l = 0; l < lanes; ++l) fillBlock(out.of(b, 0), column + l, row, static_cast<float>(solver.weight(b)[l]));
  }
}

}  // namespace

WeightMaps scaleWeights(const Estimate& x, const std::vector<const Estimate*>& candidates, const Features* features) {
  const Plane<float> roots = commonErrorRoots(candidates);
  const PairPlanes blocks[2] = {blockErrors(x, candidates, roots, 0), blockErrors(x, candidates, roots, 1)};
  PairPlanes m;
  for (size_t p = 0; p < blocks[0].size(); ++p)
    m.emplace_back(blocks[0][p].width, blocks[0][p].height,
                   finiteFloat(0.5 * (planeMean(blocks[0][p]) + planeMean(blocks[1][p]))));
  const Plane<float> pooled = pooledNoise(x, roots);
  for (const int radius : kWindows) drawTo(blocks, pooled, candidates.size(), radius, m);
  WeightMaps out = uniformWeights(candidates.size(), 1, x.mean.width(), x.mean.height());
  parallelRows(m[0].height, [&](int row) { solveRow(m, row, out); });
  return filteredWeights(out, weightedEstimate(out, candidates), features, kErrorBlock);
}

}  // namespace braid
