// SPDX-License-Identifier: Apache-2.0
#include "integrators/guiding/pixel_grid.h"

namespace braid {

namespace {

constexpr double kDarkest = 0.1;
constexpr int kSurroundings = 2;

int steps(int length, int stride) { return (length + stride - 1) / stride; }

}  // namespace

PixelGrid::PixelGrid(const Settings& s, uint64_t places, bool between) : width_(s.width), height_(s.height) {
  const auto count = [&](int stride) {
    return static_cast<uint64_t>(steps(width_, stride)) * static_cast<uint64_t>(steps(height_, stride));
  };
  while (count(stride_) > std::max<uint64_t>(places, 1)) ++stride_;
  offset_ = between ? 0 : stride_ / 2;
  columns_ = steps(width_, stride_);
  rows_ = steps(height_, stride_);
}

std::vector<float> PixelGrid::inverseBrightness(const std::vector<double>& mean) const {
  double whole = 0;
  for (const double m : mean) whole += m / static_cast<double>(mean.size());
  std::vector<float> inverse(size());
  for (int y = 0; y < rows_; ++y)
    for (int x = 0; x < columns_; ++x) {
      double sum = 0, count = 0;
      for (int v = std::max(0, y - kSurroundings); v <= std::min(rows_ - 1, y + kSurroundings); ++v)
        for (int u = std::max(0, x - kSurroundings); u <= std::min(columns_ - 1, x + kSurroundings); ++u, ++count)
          sum += mean[static_cast<size_t>(v * columns_ + u)];
      const double brightness = sum / count + kDarkest * whole;
      inverse[static_cast<size_t>(y * columns_ + x)] = brightness > 0 ? static_cast<float>(1 / brightness) : 0.0f;
    }
  return inverse;
}

}  // namespace braid
