// SPDX-License-Identifier: Apache-2.0
#include "combiners/square_units.h"

#include <algorithm>
#include <cmath>

#include "combiners/finite_float.h"
#include "combiners/mirror.h"
#include "combiners/plane_mean.h"

namespace braid {

namespace {

constexpr int kLevelRadius = 3;
constexpr double kRelativeEpsilon = 1e-6;  // of the mean noise, for pixels without any

}  // namespace

Plane<double> squareUnits(const Plane<float>& a, const Plane<float>& b, const Plane<float>& noise) {
  Plane<float> levels(a.width, a.height, kUnfilled);
  parallelChunks(levels.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      levels[i] = 0.5f * (std::sqrt(std::max(0.0f, a[i])) + std::sqrt(std::max(0.0f, b[i])));
  });
  levels = mirrorBoxMean<float>(levels, kLevelRadius);
  const double epsilon = noise.empty() ? 0 : kRelativeEpsilon * planeMean(noise) + 1e-30;
  Plane<double> out(a.width, a.height);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float squaredLevel = finiteFloat(sqr(sqr(static_cast<double>(levels[i]))) + 0.01);
      const double deviation = noise.empty() ? 1 : std::sqrt(static_cast<double>(noise[i]) + epsilon);
      out[i] = deviation * std::sqrt(static_cast<double>(squaredLevel));
    }
  });
  return out;
}

}  // namespace braid
