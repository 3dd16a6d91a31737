// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/sure_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "combiners/pixels/plane_mean.h"
#include "renderer/core/hash.h"
#include "renderer/core/parallel.h"
#include "renderer/core/vectorised.h"

namespace braid {

namespace {

constexpr int kRadius = 5;
constexpr double kTrimmed = 0.001;

// A standard normal variate by Box and Muller.
double normalVariate(uint64_t seed, uint64_t item) {
  const uint64_t a = hashCombine(seed, 2 * item), b = hashCombine(seed, 2 * item + 1);
  const double u = (static_cast<double>(a >> 11) + 0.5) * 0x1p-53, v = static_cast<double>(b >> 11) * 0x1p-53;
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * static_cast<double>(kPi) * v);
}

template <class Body>
void forAllValues(const Rgb<float>& image, const Body& body) {
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(image.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) body(c, i);
    });
}

// sum[x] += weight in[x]
void addWeighted(double weight, const double* __restrict in, int count, double* __restrict sum) {
  for (int x = 0; x < count; ++x) sum[x] += weight * in[x];
}

}  // namespace

SureMaps sureMaps(const Rgb<float>& noisy, const Rgb<float>& denoised, const Rgb<float>& variance, uint64_t seed,
                  double step, const std::function<Rgb<float>(const Rgb<float>&)>& denoise) {
  const int width = noisy.width(), height = noisy.height();
  Rgb<float> b(width, height), moved[2] = {{width, height}, {width, height}};
  forAllValues(noisy, [&](size_t c, size_t i) {
    const double deviation = std::sqrt(std::max(0.0, static_cast<double>(variance[c][i])));
    b[c][i] = static_cast<float>(deviation * normalVariate(seed, 3 * static_cast<uint64_t>(i) + c));
    moved[0][c][i] = noisy[c][i] + static_cast<float>(step) * b[c][i];
    moved[1][c][i] = noisy[c][i] - static_cast<float>(step) * b[c][i];
  });
  for (Rgb<float>& image : moved) image = denoise(image);
  SureMaps out;
  out.risk = Rgb<float>(width, height);
  forAllValues(noisy, [&](size_t c, size_t i) {
    const double difference = static_cast<double>(denoised[c][i]) - static_cast<double>(noisy[c][i]);
    const double change = static_cast<double>(moved[0][c][i]) - static_cast<double>(moved[1][c][i]);
    const double divergence = static_cast<double>(b[c][i]) * change / step;
    out.risk[c][i] = static_cast<float>(difference * difference - static_cast<double>(variance[c][i]) + divergence);
    b[c][i] = static_cast<float>(0.5 * divergence);
  });
  out.covariance = std::move(b);
  return out;
}

double sureMapFilterSigma(const Rgb<float>& variance) {
  std::vector<float> values;
  for (const Plane<float>& p : variance.channel) values.insert(values.end(), p.data.begin(), p.data.end());
  if (values.empty()) return 0.1;
  const auto kept = values.size() - static_cast<size_t>(kTrimmed * static_cast<double>(values.size()));
  std::nth_element(values.begin(), values.begin() + static_cast<ptrdiff_t>(kept), values.end());
  double sum = 0;
  for (size_t i = 0; i < kept; ++i) sum += static_cast<double>(values[i]);
  return 100 * std::clamp(std::sqrt(sum / static_cast<double>(kept)), 1e-3, 1.0);
}

Plane<float> gaussianFiltered(const Plane<float>& in, double sigma) {
  std::array<double, 2 * kRadius + 1> weight;
  double total = 0;
  for (int d = -kRadius; d <= kRadius; ++d)
    total += weight[static_cast<size_t>(d + kRadius)] = std::exp(-0.5 * d * d / (sigma * sigma));
  for (double& w : weight) w /= total;
  const int width = in.width, height = in.height;
  Plane<double> rows(width, height);
  parallelRows(height, [&](int y) {
    std::vector<double> padded(static_cast<size_t>(width + 2 * kRadius));
    for (int x = 0; x < width + 2 * kRadius; ++x)
      padded[static_cast<size_t>(x)] = static_cast<double>(in.at(std::clamp(x - kRadius, 0, width - 1), y));
    runVectorised([&] {
      for (size_t d = 0; d < weight.size(); ++d) addWeighted(weight[d], padded.data() + d, width, &rows.at(0, y));
    });
  });
  Plane<float> out(width, height);
  parallelRows(height, [&](int y) {
    std::vector<double> sums(static_cast<size_t>(width), 0.0);
    runVectorised([&] {
      for (int d = -kRadius; d <= kRadius; ++d)
        addWeighted(weight[static_cast<size_t>(d + kRadius)], &rows.at(0, std::clamp(y + d, 0, height - 1)), width,
                    sums.data());
    });
    for (int x = 0; x < width; ++x) out.at(x, y) = static_cast<float>(sums[static_cast<size_t>(x)]);
  });
  return out;
}

Rgb<float> gaussianFiltered(const Rgb<float>& in, double sigma) {
  Rgb<float> out;
  for (size_t c = 0; c < 3; ++c) out[c] = gaussianFiltered(in[c], sigma);
  return out;
}

void applySignRule(Rgb<float>& filtered, const Rgb<float>& unfiltered, const Rgb<float>& variance) {
  for (size_t c = 0; c < 3; ++c) {
    const bool helps = planeMean(variance[c]) > planeMean(unfiltered[c]);
    parallelChunks(filtered[c].size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        filtered[c][i] = helps ? std::max(0.0f, filtered[c][i]) : std::fabs(filtered[c][i]);
    });
  }
}

}  // namespace braid
