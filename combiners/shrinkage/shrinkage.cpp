// SPDX-License-Identifier: Apache-2.0
#include "combiners/shrinkage/shrinkage.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "combiners/pixels/window.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/pixels/mirror.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr double kContradiction = 3;  // deviations from Y at which a pixel contradicts it
constexpr int kAround = 2;            // radius of the window that shows how far off Y is
constexpr double kShare = 0.5;  // of `least`: the most that another such pixel says, which may be a firefly as well

constexpr double kLeastSum = 1e-5;        // released code
constexpr double kRelativeLeast = 1e-12;  // of a squared difference, relative to x²: below it is rounding

constexpr float kFireflyVariance = 1.0f / 25;  // of the variance of a firefly that was replaced

template <class Body>
void forAll(size_t count, const Body& body) {
  parallelChunks(count, kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) body(i);
  });
}

double pixelsOfBlock(const JamesSteinSettings& s) { return (2.0 * s.radius + 1) * (2.0 * s.radius + 1); }

// Combines values of the mirrored window along x, then along y, one by one.
template <class Combine>
Plane<float> separable(const Plane<float>& in, int radius, const Combine& combine) {
  Plane<double> rows(in.width, in.height);
  Plane<float> out(in.width, in.height);
  parallelRows(in.height, [&](int y) {
    for (int x = 0; x < in.width; ++x) {
      double sum = 0;
      for (int d = -radius; d <= radius; ++d)
        sum = combine(sum, static_cast<double>(in.at(mirrorIndex(x + d, in.width), y)), d);
      rows.at(x, y) = sum;
    }
  });
  parallelRows(in.height, [&](int y) {
    for (int x = 0; x < in.width; ++x) {
      double sum = 0;
      for (int d = -radius; d <= radius; ++d) sum = combine(sum, rows.at(x, mirrorIndex(y + d, in.height)), d);
      out.at(x, y) = finiteFloat(sum);
    }
  });
  return out;
}

Plane<float> gaussianMean(const Plane<float>& in, int radius, double sigma) {
  std::vector<double> weights(static_cast<size_t>(2 * radius + 1));
  double total = 0;
  for (int d = -radius; d <= radius; ++d)
    total += weights[static_cast<size_t>(d + radius)] = std::exp(-d * d / (2 * sigma * sigma));
  return separable(in, radius, [&](double sum, double value, int d) {
    return sum + value * weights[static_cast<size_t>(d + radius)] / total;
  });
}

// What is subtracted from SSE, before the constant, over (p - 2): sigma², or its robust counterpart.
Plane<float> noiseOfBlocks(const Plane<float>& variance, const JamesSteinSettings& s) {
  if (s.filter == VarianceFilter::Gaussian) return gaussianMean(variance, s.radius, std::max(s.sigma, 1e-3));
  Plane<float> out = mirrorBoxMean<float>(variance, s.radius);
  if (s.filter != VarianceFilter::Robust) return out;
  const Plane<float> most =
      separable(variance, s.radius, [](double sum, double value, int) { return std::max(sum, value); });
  const double p = pixelsOfBlock(s);
  forAll(out.size(), [&](size_t i) {
    const double rest = p * static_cast<double>(out[i]) - 2 * static_cast<double>(most[i]);
    out[i] = finiteFloat(std::max(0.0, rest / (p - 2)));
  });
  return out;
}

// One over what a squared difference is measured in.
Plane<float> inverseUnits(const Plane<float>& variance) {
  Plane<float> out = usualVariance(variance);
  forAll(out.size(), [&](size_t i) {
    const double unit = 0.5 * (static_cast<double>(variance[i]) + static_cast<double>(out[i]));
    out[i] = static_cast<float>(1 / std::max(unit, 1e-30));
  });
  return out;
}

double total(const Plane<float>& in) {
  return parallelSum(in.size(), kPixelChunk, 0.0, [&](size_t begin, size_t end) {
    double sum = 0;
    for (size_t i = begin; i < end; ++i) sum += static_cast<double>(in[i]);
    return sum;
  });
}

// The squared differences of X and Y and the variance of X, in units of the scale: what the factors are made of.
struct Terms {
  Plane<float> squares, noise;
};

// The mean factor of every pixel of one channel; those of blocks are not below `least`, if any. `blocks` has the noise
// of blocks where it is known, else it is empty.
Plane<float> factors(Terms terms, const JamesSteinSettings& s, const Plane<float>& blocks, const Plane<float>* least) {
  if (s.global) {
    const auto n = static_cast<double>(terms.squares.size());
    const double numerator = s.constant * std::max(0.0, n - 2) / n * total(terms.noise);
    return {terms.squares.width, terms.squares.height,
            finiteFloat(shrinkageFactor(numerator, total(terms.squares), s.positivePart))};
  }
  const double p = pixelsOfBlock(s);
  Plane<float> noise = blocks.empty() ? noiseOfBlocks(terms.noise, s) : blocks;
  terms.noise = {};  // no more memory at once than is needed: the first touch of new memory takes longer than the loop
  Plane<float> factor = mirrorBoxMean<float>(terms.squares, s.radius);
  terms.squares = {};
  forAll(factor.size(), [&](size_t i) {
    const double numerator = s.constant * (p - 2) * static_cast<double>(noise[i]);
    factor[i] = finiteFloat(shrinkageFactor(numerator, p * static_cast<double>(factor[i]), s.positivePart));
  });
  noise = {};
  if (least) forAll(factor.size(), [&](size_t i) { factor[i] = std::max(factor[i], (*least)[i]); });
  return mirrorBoxMean<float>(factor, s.radius);
}

struct TermRows {
  std::array<const float*, 3> x, y, variance, inverseUnit;
};

// The means over the channels of max(d², rounding) / unit and of variance / unit; without units they are 1.
template <size_t kChannels, bool kUnits>
void termsOfRow(const TermRows& in, size_t count, float* __restrict squares, float* __restrict noise) {
  for (size_t i = 0; i < count; ++i) {
    double square = 0, variance = 0;
    for (size_t c = 0; c < kChannels; ++c) {
      const double inverse = kUnits ? static_cast<double>(in.inverseUnit[c][i]) : 1.0;
      const auto value = static_cast<double>(in.x[c][i]), difference = value - static_cast<double>(in.y[c][i]);
      square += inverse * std::max(difference * difference, kRelativeLeast * value * value);
      variance += inverse * static_cast<double>(in.variance[c][i]);
    }
    squares[i] = finiteFloat(square / kChannels);
    noise[i] = finiteFloat(variance / kChannels);
  }
}

void termsOfRow(const TermRows& in, size_t channels, size_t count, float* squares, float* noise) {
  const bool units = in.inverseUnit[0] != nullptr;
  if (channels == 3)
    units ? termsOfRow<3, true>(in, count, squares, noise) : termsOfRow<3, false>(in, count, squares, noise);
  else
    units ? termsOfRow<1, true>(in, count, squares, noise) : termsOfRow<1, false>(in, count, squares, noise);
}

// Of the channels [first, first + together), averaged; nothing of gated pixels.
Terms termsOf(const Rgb<float>& x, const Rgb<float>& variance, const NoiseScale& scale, const Rgb<float>& y,
              size_t first, size_t together) {
  Terms out{Plane<float>(x.width(), x.height(), kUnfilled), Plane<float>(x.width(), x.height(), kUnfilled)};
  parallelChunks(x.size(), kPixelChunk, [&](size_t begin, size_t end) {
    TermRows rows{};
    for (size_t c = 0; c < together; ++c) {
      const auto at = [&](const Plane<float>& plane) { return plane.empty() ? nullptr : &plane[begin]; };
      rows.x[c] = at(x[first + c]);
      rows.y[c] = at(y[first + c]);
      rows.variance[c] = at(variance[first + c]);
      rows.inverseUnit[c] = at(scale.inverseUnit[first + c]);
    }
    runVectorised([&] { termsOfRow(rows, together, end - begin, &out.squares[begin], &out.noise[begin]); });
    for (size_t i = begin; i < end; ++i)
      if (isLoneFirefly(scale.gate, x, y, i)) out.squares[i] = out.noise[i] = 0;
  });
  return out;
}

// out = max(0, y + factor (x - y))
void blendRow(const float* __restrict x, const float* __restrict y, const float* __restrict factor, size_t count,
              float* __restrict out) {
  for (size_t i = 0; i < count; ++i) {
    const auto other = static_cast<double>(y[i]);
    out[i] = finiteFloat(std::max(0.0, other + static_cast<double>(factor[i]) * (static_cast<double>(x[i]) - other)));
  }
}

}  // namespace

double shrinkageFactor(double numerator, double sumOfSquares, bool positivePart) {
  const double factor = 1 - numerator / std::max(sumOfSquares, kLeastSum);
  if (!std::isfinite(factor)) return 0;
  return positivePart ? std::max(0.0, factor) : factor;
}

Plane<float> usualVariance(const Plane<float>& variance) {
  Plane<float> roots(variance.width, variance.height, kUnfilled);
  forAll(roots.size(), [&](size_t i) { roots[i] = std::sqrt(std::sqrt(std::max(0.0f, variance[i]))); });
  Plane<float> mean = mirrorBoxMean<float>(roots, 3);
  forAll(mean.size(), [&](size_t i) { mean[i] = finiteFloat(sqr(sqr(static_cast<double>(mean[i])))); });
  return mean;
}

NoiseScale noiseScale(const Rgb<float>& variance, const JamesSteinSettings& settings) {
  NoiseScale scale;
  if (settings.filter == VarianceFilter::Whitened)
    for (size_t c = 0; c < 3; ++c) scale.inverseUnit[c] = inverseUnits(variance[c]);
  if (settings.gate) scale.gate = fireflyGate(variance, settings.radius);
  return scale;
}

// Where the standard deviation of a pixel, over the channels, is beyond 5 times that of its surroundings, one sample
// carries it: X says nothing there that Y would contradict, unless they differ by 3 deviations or more (k samples of
// many make sqrt(k)). The deviation around is the square of the mean root, so that a dozen fireflies in a window do not
// hide each other.
Plane<float> fireflyGate(const Rgb<float>& variance, int radius) {
  Plane<float> deviation(variance.width(), variance.height(), kUnfilled),
      roots(variance.width(), variance.height(), kUnfilled);
  forAll(roots.size(), [&](size_t i) {
    double v = 0;
    for (size_t c = 0; c < 3; ++c) v += static_cast<double>(variance[c][i]) / 3;
    deviation[i] = static_cast<float>(std::sqrt(v));
    roots[i] = std::sqrt(deviation[i]);
  });
  const Plane<float> around = mirrorBoxMean<float>(roots, radius);
  forAll(roots.size(), [&](size_t i) {
    const auto own = static_cast<double>(deviation[i]);
    deviation[i] = own > 5 * sqr(static_cast<double>(around[i])) ? finiteFloat(sqr(kContradiction * own)) : 0.0f;
  });
  return deviation;
}

bool isLoneFirefly(const Plane<float>& gate, const Rgb<float>& x, const Rgb<float>& y, size_t i) {
  if (gate.empty() || gate[i] <= 0) return false;
  const auto squareAt = [&](size_t k) {
    double square = 0;
    for (size_t c = 0; c < 3; ++c) square += sqr(static_cast<double>(x[c][k]) - static_cast<double>(y[c][k])) / 3;
    return square;
  };
  const auto least = static_cast<double>(gate[i]);
  if (squareAt(i) >= least) return false;
  const auto width = static_cast<size_t>(gate.width);
  const int column = static_cast<int>(i % width), row = static_cast<int>(i / width);
  double sum = 0, pixels = 0;
  for (int v = std::max(0, row - kAround); v <= std::min(gate.height - 1, row + kAround); ++v)
    for (int u = std::max(0, column - kAround); u <= std::min(gate.width - 1, column + kAround); ++u)
      if (const size_t k = gate.index(u, v); k != i) {
        sum += gate[k] > 0 ? std::min(squareAt(k), kShare * least) : squareAt(k);
        ++pixels;
      }
  return sum <= pixels * least / sqr(kContradiction);
}

Estimate withoutLoneFireflies(const Estimate& x, const Estimate& y, Rgb<float>& variance) {
  const Plane<float> gate = fireflyGate(variance, kGateRadius);
  Estimate out;
  out.name = x.name;
  out.passes = x.passes;
  out.mean = x.mean;
  for (int h = 0; h < 2; ++h) out.half[h] = x.half[h];
  parallelChunks(gate.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (!isLoneFirefly(gate, x.mean, y.mean, i)) continue;
      for (size_t c = 0; c < 3; ++c) {
        out.mean[c][i] = y.mean[c][i];
        for (int h = 0; h < 2; ++h) out.half[h][c][i] = y.half[h][c][i];
        variance[c][i] *= kFireflyVariance;
      }
    }
  });
  return out;
}

ShrunkImage jamesStein(const Rgb<float>& x, const Rgb<float>& variance, const Rgb<float>& y,
                       const JamesSteinSettings& settings) {
  return jamesStein(x, variance, noiseScale(variance, settings), y, settings);
}

ShrunkImage jamesStein(const Rgb<float>& x, const Rgb<float>& variance, const NoiseScale& scale, const Rgb<float>& y,
                       const JamesSteinSettings& settings, const LeastFactors* least) {
  BRAID_ASSERT((!least && scale.blocks[0].empty()) || !settings.global);
  ShrunkImage out;
  out.image = Rgb<float>(x.width(), x.height(), kUnfilled);
  const size_t together = settings.shared ? 3 : 1;
  for (size_t first = 0; first < 3; first += together) {
    Plane<float> factor = factors(termsOf(x, variance, scale, y, first, together), settings, scale.blocks[first],
                                  least ? &least->blocks[first] : nullptr);
    const Plane<float>* const ofFireflies =
        least && !least->fireflies[first].empty() ? &least->fireflies[first] : nullptr;
    parallelChunks(x.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        if (isLoneFirefly(scale.gate, x, y, i)) factor[i] = ofFireflies ? (*ofFireflies)[i] : 0;
      for (size_t c = first; c < first + together; ++c)
        runVectorised([&] { blendRow(&x[c][begin], &y[c][begin], &factor[begin], end - begin, &out.image[c][begin]); });
    });
    for (size_t c = first; settings.keepFactors && c < first + together; ++c) out.factor[c] = factor;
  }
  return out;
}

}  // namespace braid
