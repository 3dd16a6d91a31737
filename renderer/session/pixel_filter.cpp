// SPDX-License-Identifier: Apache-2.0
#include "renderer/session/pixel_filter.h"

#include <algorithm>
#include <array>

namespace braid {

namespace {

constexpr size_t kTable = 256;

// Inverse of the cumulative distribution of a positive, symmetric filter of the given radius, tabulated at u = i /
// kTable.
template <class F>
std::array<float, kTable + 1> invertFilter(float radius, const F& filter) {
  constexpr int kSteps = 8192;
  std::array<double, kSteps + 1> cumulative{};
  for (int i = 0; i < kSteps; ++i) {
    const double x = (2 * (i + 0.5) / kSteps - 1) * static_cast<double>(radius);
    cumulative[static_cast<size_t>(i) + 1] = cumulative[static_cast<size_t>(i)] + filter(x);
  }
  std::array<float, kTable + 1> inverse{};
  size_t step = 0;
  for (size_t i = 0; i <= kTable; ++i) {
    const double target = cumulative[kSteps] * static_cast<double>(i) / kTable;
    while (step + 1 < kSteps && cumulative[step + 1] < target) ++step;
    const double width = cumulative[step + 1] - cumulative[step];
    const double position =
        static_cast<double>(step) + (width > 0 ? std::clamp((target - cumulative[step]) / width, 0.0, 1.0) : 0.5);
    inverse[i] = static_cast<float>((2 * position / kSteps - 1) * static_cast<double>(radius));
  }
  return inverse;
}

float lookUp(const std::array<float, kTable + 1>& inverse, float u) {
  const float x = u * static_cast<float>(kTable);
  const size_t i = std::min(static_cast<size_t>(x), kTable - 1);
  const float f = x - static_cast<float>(i);
  return inverse[i] * (1 - f) + inverse[i + 1] * f;
}

}  // namespace

float sampleFilter(PixelFilter filter, float u) {
  switch (filter) {
    case PixelFilter::Box:
      break;
    case PixelFilter::Gaussian: {
      static const auto inverse = invertFilter(1.5f, [](double x) { return std::exp(-2 * x * x); });
      return lookUp(inverse, u);
    }
    case PixelFilter::BlackmanHarris: {
      static const auto inverse = invertFilter(1.65f, [](double x) {
        const double t = (x / 1.65 + 1) * static_cast<double>(kPi);
        return std::max(0.0, 0.35875 - 0.48829 * std::cos(t) + 0.14128 * std::cos(2 * t) - 0.01168 * std::cos(3 * t));
      });
      return lookUp(inverse, u);
    }
  }
  return u - 0.5f;
}

const char* toString(PixelFilter filter) {
  return filter == PixelFilter::Box ? "box" : filter == PixelFilter::Gaussian ? "gaussian" : "blackman-harris";
}

}  // namespace braid
