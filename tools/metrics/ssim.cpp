// SPDX-License-Identifier: Apache-2.0
// Structural similarity (Wang et al. 2004): 11 x 11 Gaussian windows of sigma 1.5, K1 = 0.01, K2 = 0.03, range 1;
// borders replicated.
#include <cmath>
#include <vector>

#include "renderer/core/parallel.h"
#include "tools/metrics/filter.h"
#include "tools/metrics/metrics.h"
#include "tools/metrics/tonemap.h"

namespace braid {

namespace {

constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;

std::vector<double> window() {
  std::vector<double> taps(11);
  double sum = 0;
  for (int i = 0; i < 11; ++i) sum += taps[static_cast<size_t>(i)] = std::exp(-sqr(i - 5.0) / (2 * 1.5 * 1.5));
  for (double& t : taps) t /= sum;
  return taps;
}

Plane<double> product(const Plane<double>& a, const Plane<double>& b) {
  Plane<double> out(a.width, a.height);
  parallelChunks(a.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = a[i] * b[i];
  });
  return out;
}

Plane<double> display(const Plane<float>& linear) {
  Plane<double> out(linear.width, linear.height);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = static_cast<double>(displayValue(linear[i]));
  });
  return out;
}

}  // namespace

Plane<double> dssimErrors(const Rgb<float>& image, const Rgb<float>& reference) {
  const std::vector<double> taps = window();
  // In double: variances are differences of squares here.
  const auto average = [&taps](const Plane<double>& p) { return filterColumns(filterRows(p, taps), taps); };
  Plane<double> out(image.width(), image.height());
  for (size_t c = 0; c < 3; ++c) {
    const Plane<double> x = display(image[c]), y = display(reference[c]);
    const Plane<double> mx = average(x), my = average(y);
    const Plane<double> xx = average(product(x, x)), yy = average(product(y, y)), xy = average(product(x, y));
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const double mean2 = mx[i] * my[i], varX = xx[i] - sqr(mx[i]), varY = yy[i] - sqr(my[i]);
        const double ssim =
            (2 * mean2 + kC1) * (2 * (xy[i] - mean2) + kC2) / ((sqr(mx[i]) + sqr(my[i]) + kC1) * (varX + varY + kC2));
        out[i] += (1 - ssim) / 6;
      }
    });
  }
  return out;
}

}  // namespace braid
