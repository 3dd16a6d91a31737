// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/planes/plane_network.h"

#include <algorithm>

#include <fmt/format.h>

#include "combiners/learned/network_file.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr int kLargestSquare = 4;

// The square's side, from the channels of the network.
int squareOf(const Network& network, int planes, const std::string& path) {
  const int outputs = network.layers.back().outputs;
  for (int side = 1; side <= kLargestSquare; ++side)
    if (network.inputs == planes * side * side && outputs > 0 && outputs % (side * side) == 0) return side;
  throw Error(ExitCode::BadInput,
              fmt::format("{}: {} channels become {}, but here {} planes are read: train it again (tools/train)", path,
                          network.inputs, outputs, planes));
}

// The pixels of each plane's squares become channels; beyond the image there is nothing.
void packSquares(std::span<const Plane<float>> planes, int side, int y, int x0, int x1, float* row) {
  for (int x = x0; x < x1; ++x)
    for (const Plane<float>& plane : planes)
      for (int k = 0; k < side * side; ++k) {
        const int u = side * x + k % side, v = side * y + k / side;
        *row++ = u < plane.width && v < plane.height ? plane.at(u, v) : 0.0f;
      }
}

// One of the rows of pixels that a row of squares holds.
void unpackSquares(const float* squares, int side, int within, int outputs, std::vector<float>& row) {
  float* to = row.data();
  for (size_t x = 0; x < row.size() / static_cast<size_t>(outputs); ++x) {
    const auto u = static_cast<int>(x) % side;
    const float* square = squares + (x / static_cast<size_t>(side)) * static_cast<size_t>(outputs * side * side);
    for (int o = 0; o < outputs; ++o) *to++ = square[(o * side + within) * side + u];
  }
}

}  // namespace

PlaneNetwork::PlaneNetwork(const std::string& path, int planes, const ConvolutionLibrary& library)
    : network_([&] {
        NetworkFile file = readNetworkFile(path);
        side_ = squareOf(file.network, planes, path);
        outputs_ = file.network.layers.back().outputs / (side_ * side_);
        return TiledNetwork(std::move(file.network), library);
      }()) {}

void PlaneNetwork::run(std::span<const Plane<float>> planes, const Write& write, const std::atomic<bool>* cancel) {
  const int width = planes[0].width, height = planes[0].height;
  NetworkImage image;
  image.width = (width + side_ - 1) / side_;
  image.height = (height + side_ - 1) / side_;
  image.cancel = cancel;
  image.read = [&](int y, int x0, int x1, float* row) { packSquares(planes, side_, y, x0, x1, row); };
  image.write = [&](int y, int x0, int x1, const float* squares) {
    const int first = side_ * x0, last = std::min(width, side_ * x1);
    std::vector<float> row(static_cast<size_t>(last - first) * static_cast<size_t>(outputs_));
    for (int v = side_ * y; v < std::min(height, side_ * (y + 1)); ++v) {
      unpackSquares(squares, side_, v - side_ * y, outputs_, row);
      write(v, first, last, row.data());
    }
  };
  network_.run(image);
}

}  // namespace braid
