// SPDX-License-Identifier: Apache-2.0
#include "combiners/shrinkage.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "combiners/finite_float.h"
#include "combiners/mirror.h"

namespace braid {

namespace {

constexpr double kLeastSum = 1e-5;        // released code
constexpr double kRelativeLeast = 1e-12;  // of a squared difference, relative to x²: below it is rounding

template <class Body>
void forAll(size_t count, const Body& body) {
  parallelChunks(count, kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) body(i);
  });
}

// Combines values of the mirrored window along x, then along y, one by one.
template <class Combine>
Plane<double> separable(const Plane<double>& in, int radius, const Combine& combine) {
  Plane<double> rows(in.width, in.height), out(in.width, in.height);
  parallelRows(in.height, [&](int y) {
    for (int x = 0; x < in.width; ++x) {
      double sum = 0;
      for (int d = -radius; d <= radius; ++d) sum = combine(sum, in.at(mirrorIndex(x + d, in.width), y), d);
      rows.at(x, y) = sum;
    }
  });
  parallelRows(in.height, [&](int y) {
    for (int x = 0; x < in.width; ++x) {
      double sum = 0;
      for (int d = -radius; d <= radius; ++d) sum = combine(sum, rows.at(x, mirrorIndex(y + d, in.height)), d);
      out.at(x, y) = sum;
    }
  });
  return out;
}

Plane<double> gaussianMean(const Plane<double>& in, int radius, double sigma) {
  std::vector<double> weights(static_cast<size_t>(2 * radius + 1));
  double total = 0;
  for (int d = -radius; d <= radius; ++d)
    total += weights[static_cast<size_t>(d + radius)] = std::exp(-d * d / (2 * sigma * sigma));
  return separable(in, radius, [&](double sum, double value, int d) {
    return sum + value * weights[static_cast<size_t>(d + radius)] / total;
  });
}

// What is subtracted from SSE, before the constant: (p - 2) sigma², or its robust counterpart.
Plane<double> numerators(const Plane<double>& variance, const JamesSteinSettings& s) {
  const double p = (2.0 * s.radius + 1) * (2.0 * s.radius + 1);
  Plane<double> out = s.filter == VarianceFilter::Gaussian ? gaussianMean(variance, s.radius, std::max(s.sigma, 1e-3))
                                                           : mirrorBoxMean(variance, s.radius);
  if (s.filter != VarianceFilter::Robust) {
    forAll(out.size(), [&](size_t i) { out[i] *= p - 2; });
    return out;
  }
  const Plane<double> most =
      separable(variance, s.radius, [](double sum, double value, int) { return std::max(sum, value); });
  forAll(out.size(), [&](size_t i) { out[i] = std::max(0.0, p * out[i] - 2 * most[i]); });
  return out;
}

// What a difference is measured in, squared.
Plane<double> units(const Plane<float>& variance) {
  Plane<double> roots(variance.width, variance.height);
  forAll(roots.size(), [&](size_t i) { roots[i] = std::sqrt(std::sqrt(static_cast<double>(variance[i]))); });
  Plane<double> out = mirrorBoxMean(roots, 3);
  forAll(out.size(), [&](size_t i) {
    const double around = out[i] * out[i] * out[i] * out[i];
    out[i] = std::max(0.5 * (static_cast<double>(variance[i]) + around), 1e-30);
  });
  return out;
}

double total(const Plane<double>& in) {
  return parallelSum(in.size(), kPixelChunk, 0.0, [&](size_t begin, size_t end) {
    double sum = 0;
    for (size_t i = begin; i < end; ++i) sum += in[i];
    return sum;
  });
}

// The mean factor of every pixel of one channel.
Plane<double> factors(const Plane<double>& squares, const Plane<double>& variance, const JamesSteinSettings& s) {
  if (s.global) {
    const auto n = static_cast<double>(squares.size());
    const double numerator = s.constant * std::max(0.0, n - 2) / n * total(variance);
    return {squares.width, squares.height, shrinkageFactor(numerator, total(squares), s.positivePart)};
  }
  const double p = (2.0 * s.radius + 1) * (2.0 * s.radius + 1);
  const Plane<double> numerator = numerators(variance, s);
  Plane<double> factor = mirrorBoxMean(squares, s.radius);
  forAll(factor.size(),
         [&](size_t i) { factor[i] = shrinkageFactor(s.constant * numerator[i], p * factor[i], s.positivePart); });
  return mirrorBoxMean(factor, s.radius);
}

// Standard deviations, over the channels, of pixels and of their surroundings. The latter is the square of the mean
// root, so that a dozen outliers in a window do not hide each other.
void addDeviations(const Rgb<float>& variance, int radius, NoiseScale& scale) {
  scale.deviation = Plane<double>(variance.width(), variance.height());
  Plane<double> roots(variance.width(), variance.height());
  forAll(roots.size(), [&](size_t i) {
    double v = 0;
    for (size_t c = 0; c < 3; ++c) v += static_cast<double>(variance[c][i]) / 3;
    scale.deviation[i] = std::sqrt(v);
    roots[i] = std::sqrt(scale.deviation[i]);
  });
  scale.around = mirrorBoxMean(roots, radius);
  forAll(roots.size(), [&](size_t i) { scale.around[i] *= scale.around[i]; });
}

// Whether the standard deviation of a pixel is beyond 5 times that of its surroundings although X and Y differ by less
// than 4 of them: one sample carries it, and X says nothing that Y would contradict.
bool gated(const NoiseScale& scale, const Rgb<float>& x, const Rgb<float>& y, size_t i) {
  if (scale.deviation.empty() || !(scale.deviation[i] > 5 * scale.around[i])) return false;
  double square = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double d = static_cast<double>(x[c][i]) - static_cast<double>(y[c][i]);
    square += d * d / 3;
  }
  return std::sqrt(square) < 4 * scale.deviation[i];
}

}  // namespace

double shrinkageFactor(double numerator, double sumOfSquares, bool positivePart) {
  const double factor = 1 - numerator / std::max(sumOfSquares, kLeastSum);
  if (!std::isfinite(factor)) return 0;
  return positivePart ? std::max(0.0, factor) : factor;
}

NoiseScale noiseScale(const Rgb<float>& variance, const JamesSteinSettings& settings) {
  NoiseScale scale;
  if (settings.filter == VarianceFilter::Whitened)
    for (size_t c = 0; c < 3; ++c) scale.unit[c] = units(variance[c]);
  if (settings.gate) addDeviations(variance, settings.radius, scale);
  return scale;
}

ShrunkImage jamesStein(const Rgb<float>& x, const Rgb<float>& variance, const Rgb<float>& y,
                       const JamesSteinSettings& settings) {
  return jamesStein(x, variance, noiseScale(variance, settings), y, settings);
}

ShrunkImage jamesStein(const Rgb<float>& x, const Rgb<float>& variance, const NoiseScale& scale, const Rgb<float>& y,
                       const JamesSteinSettings& settings) {
  const int width = x.width(), height = x.height();
  ShrunkImage out{Rgb<float>(width, height), Rgb<float>(width, height)};
  const size_t together = settings.shared ? 3 : 1;
  for (size_t first = 0; first < 3; first += together) {
    Plane<double> squares(width, height), noise(width, height);
    forAll(x.size(), [&](size_t i) {
      if (gated(scale, x, y, i)) return;
      for (size_t c = first; c < first + together; ++c) {
        const double unit = scale.unit[c].empty() ? 1.0 : scale.unit[c][i];
        const double weight = 1.0 / static_cast<double>(together);
        const auto value = static_cast<double>(x[c][i]), difference = value - static_cast<double>(y[c][i]);
        squares[i] += weight * std::max(difference * difference, kRelativeLeast * value * value) / unit;
        noise[i] += weight * static_cast<double>(variance[c][i]) / unit;
      }
    });
    const Plane<double> factor = factors(squares, noise, settings);
    forAll(x.size(), [&](size_t i) {
      const double rho = gated(scale, x, y, i) ? 0.0 : factor[i];
      for (size_t c = first; c < first + together; ++c) {
        const auto other = static_cast<double>(y[c][i]);
        out.image[c][i] = finiteFloat(std::max(0.0, other + rho * (static_cast<double>(x[c][i]) - other)));
        out.factor[c][i] = finiteFloat(rho);
      }
    });
  }
  return out;
}

}  // namespace braid
