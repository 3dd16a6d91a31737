// SPDX-License-Identifier: Apache-2.0
#include "renderer/session/mixture/pilot_blocks.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/vec.h"

namespace braid {

namespace {

constexpr int kBlock = 4;
// What counts as the brightness of a black block: this share of the frame's.
constexpr double kDarkestBlock = 0.1;

struct Blocks {
  explicit Blocks(const Accumulator& sums)
      : width(sums.width()), height(sums.height()), columns((width + kBlock - 1) / kBlock) {}
  size_t size() const { return static_cast<size_t>(columns) * static_cast<size_t>((height + kBlock - 1) / kBlock); }
  // The mean of body(x, y) over the pixels of a block.
  template <class Body>
  double mean(size_t block, const Body& body) const {
    const int x0 = static_cast<int>(block) % columns * kBlock, y0 = static_cast<int>(block) / columns * kBlock;
    const int x1 = std::min(x0 + kBlock, width), y1 = std::min(y0 + kBlock, height);
    double sum = 0;
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x) sum += body(x, y);
    return sum / ((x1 - x0) * (y1 - y0));
  }
  int width, height, columns;
};

template <class Body>
double meanOfChannels(const Body& body) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c) sum += static_cast<double>(body(c)) / 3;
  return sum;
}

float finite(double value) { return std::isfinite(value) ? static_cast<float>(std::clamp(value, -1e30, 1e30)) : 0.0f; }

}  // namespace

std::vector<float> blockScales(const std::vector<const Accumulator*>& images) {
  const Blocks blocks(*images.front());
  std::vector<double> mean(blocks.size(), 0.0);
  double whole = 0;
  for (const Accumulator* image : images) {
    const Rgb<float> pixels = image->mean();
    for (size_t b = 0; b < mean.size(); ++b)
      mean[b] += blocks.mean(b, [&](int x, int y) {
        return meanOfChannels([&](size_t c) { return pixels[c].at(x, y); });
      }) / static_cast<double>(images.size());
  }
  for (const double m : mean) whole += m / static_cast<double>(mean.size());
  std::vector<float> scales;
  for (const double m : mean) {
    const double square = sqr(m) + sqr(kDarkestBlock * whole);
    scales.push_back(square > 0 ? finite(1 / square) : 0.0f);
  }
  return scales;
}

std::vector<PilotBlock> blocksOf(const Accumulator& sums, bool lowDiscrepancy, const std::vector<float>& scales,
                                 double biasScale) {
  const Blocks blocks(sums);
  const Rgb<float> image = sums.mean(), variance = sums.variance(lowDiscrepancy);
  const auto varianceAt = [&](int x, int y) { return meanOfChannels([&](size_t c) { return variance[c].at(x, y); }); };
  Rgb<float> bias, biasVariance;
  if (sums.keepsBias()) bias = sums.biasMean(), biasVariance = sums.biasVariance();
  const auto biasAt = [&](int x, int y) {
    return meanOfChannels([&](size_t c) {
      return sqr(static_cast<double>(bias[c].at(x, y))) - static_cast<double>(biasVariance[c].at(x, y));
    });
  };
  std::vector<PilotBlock> list;
  for (size_t b = 0; b < blocks.size(); ++b) {
    const double scale = static_cast<double>(scales[b]), onePass = scale * static_cast<double>(sums.passes());
    // Fireflies are what makes the variance larger than the square of the mean deviation.
    const double all = blocks.mean(b, varianceAt),
                 even = sqr(blocks.mean(b, [&](int x, int y) { return std::sqrt(varianceAt(x, y)); }));
    const double mean =
        blocks.mean(b, [&](int x, int y) { return meanOfChannels([&](size_t c) { return image[c].at(x, y); }); });
    list.push_back({finite(mean * std::sqrt(scale)), finite(onePass * even),
                    finite(onePass * std::max(0.0, all - even)),
                    sums.keepsBias() ? finite(biasScale * scale * blocks.mean(b, biasAt)) : 0.0f});
  }
  return list;
}

}  // namespace braid
