// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble/scales/pooled_noise.h"

#include <algorithm>

#include "combiners/ensemble/scales/block_errors.h"
#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/finite_float.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kRadius = 12;  // in blocks, of the surroundings

double blockNoise(const Estimate& x, const Plane<float>& roots, int column, int row) {
  const int right = std::min(roots.width, (column + 1) * kErrorBlock);
  const int bottom = std::min(roots.height, (row + 1) * kErrorBlock);
  double sum = 0;
  int values = 0;
  for (int py = row * kErrorBlock; py < bottom; ++py)
    for (int px = column * kErrorBlock; px < right; ++px, values += 3) {
      const size_t i = roots.index(px, py);
      const double root = static_cast<double>(roots[i]);
      for (size_t c = 0; c < 3; ++c) sum += 2 * root * root * static_cast<double>(x.variance[c][i]);
    }
  return sum / values;
}

}  // namespace

Plane<float> pooledNoise(const Estimate& x, const Plane<float>& roots) {
  if (x.variance.empty()) return {};
  Plane<float> noise((roots.width + kErrorBlock - 1) / kErrorBlock, (roots.height + kErrorBlock - 1) / kErrorBlock,
                     kUnfilled);
  parallelRows(noise.height, [&](int row) {
    for (int column = 0; column < noise.width; ++column)
      noise.at(column, row) = finiteFloat(blockNoise(x, roots, column, row));
  });
  return boxMean<float>(noise, kRadius);
}

}  // namespace braid
