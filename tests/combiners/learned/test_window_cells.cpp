// SPDX-License-Identifier: Apache-2.0
// Weighted means over windows, and networks that see squares of pixels, against plain loops.
#include <doctest/doctest.h>

#include "combiners/learned/planes/plane_network.h"
#include "combiners/learned/planes/window_cells.h"
#include "combiners/pixels/mirror.h"
#include "renderer/core/error.h"
#include "tests/combiners/learned/network_writer.h"
#include "tests/combiners/learned/plain_network.h"
#include "tests/support/gltf_fixture.h"

namespace braid::test_window_cells {

using namespace test;

namespace {

Plane<float> randomPlane(int width, int height, uint64_t seed) {
  Plane<float> plane(width, height);
  for (size_t i = 0; i < plane.size(); ++i) plane[i] = noiseAt(seed, i);
  return plane;
}

// From the middle cell, ties away from it.
int cellOf(int d, int cells, int side) {
  const double at = static_cast<double>(d) * cells / side;
  return (cells - 1) / 2 + static_cast<int>(at < 0 ? at - 0.5 : at + 0.5);
}

}  // namespace

TEST_CASE("Means over mirrored windows by weights of cells are those of plain loops") {
  struct Shape {
    int radius, cells, width, height;
  };
  for (const Shape& s : {Shape{7, 5, 20, 9}, Shape{7, 15, 17, 18}, Shape{6, 5, 9, 30}, Shape{6, 13, 3, 2},
                         Shape{6, 1, 8, 8}, Shape{7, 5, 1, 1}}) {
    CAPTURE(s.cells);
    const Plane<float> plane = randomPlane(s.width, s.height, 3);
    const WindowCells cells(s.radius, s.cells);
    const auto count = static_cast<size_t>(cells.count()), stride = count + 2;
    for (int y = 0; y < s.height; ++y) {
      const int x0 = s.width / 3;
      std::vector<float> weights(static_cast<size_t>(s.width - x0) * stride);
      for (size_t i = 0; i < weights.size(); ++i) weights[i] = noiseAt(5 + static_cast<uint64_t>(y), i);
      std::vector<float> out(static_cast<size_t>(s.width - x0));
      cells.means(plane, y, x0, s.width, {weights.data(), stride}, out.data());
      for (int x = x0; x < s.width; ++x) {
        double sum = 0, total = 0;
        for (int dy = -s.radius; dy <= s.radius; ++dy)
          for (int dx = -s.radius; dx <= s.radius; ++dx) {
            const int side = 2 * s.radius + 1;
            const int cell = cellOf(dy, s.cells, side) * s.cells + cellOf(dx, s.cells, side);
            const auto w =
                static_cast<double>(weights[static_cast<size_t>(x - x0) * stride + static_cast<size_t>(cell)]);
            sum += w * static_cast<double>(plane.at(mirrorIndex(x + dx, s.width), mirrorIndex(y + dy, s.height)));
            total += w;
          }
        CHECK(static_cast<double>(out[static_cast<size_t>(x - x0)]) == doctest::Approx(sum / total).epsilon(1e-5));
      }
    }
  }
}

TEST_CASE("Only odd squares of at most as many cells as pixels are windows") {
  CHECK(WindowCells::across(25, 7) == 5);
  CHECK(WindowCells::across(225, 7) == 15);
  CHECK(WindowCells::across(169, 6) == 13);
  for (const int count : {0, 2, 16, 24, 225, 289}) CHECK(WindowCells::across(count, 6) == 0);
}

TEST_CASE("A network that sees squares of pixels says of each pixel what is its own") {
  if (!oneDnn()) return;
  const Folder folder;
  const std::string path = (folder.path / "n.network").string();
  for (const int side : {1, 2}) {
    CAPTURE(side);
    const int squares = side * side;
    // Of two planes three numbers: the first, twice the second, and a constant.
    std::vector<float> bias(static_cast<size_t>(3 * squares), 0.0f);
    for (int k = 0; k < squares; ++k) bias[static_cast<size_t>(2 * squares + k)] = 0.25f;
    writePixelNetwork(path, 2 * squares, bias,
                      [&](int o, int i) { return o == i ? (o < squares ? 1.0f : 2.0f) : 0.0f; });
    PlaneNetwork network(path, 2, *oneDnn());
    CHECK(network.packed() == side);
    CHECK(network.outputs() == 3);
    for (const auto& [width, height] : {std::pair{1, 1}, std::pair{5, 3}, std::pair{70, 41}}) {
      const Plane<float> planes[2] = {randomPlane(width, height, 1), randomPlane(width, height, 2)};
      Plane<float> out[3];
      for (Plane<float>& plane : out) plane = Plane<float>(width, height, -1.0f);
      network.run(
          planes,
          [&](int y, int x0, int x1, const float* row) {
            for (int x = x0; x < x1; ++x)
              for (Plane<float>& plane : out) plane.at(x, y) = *row++;
          },
          nullptr);
      for (size_t i = 0; i < out[0].size(); ++i) {
        CHECK(out[0][i] == doctest::Approx(planes[0][i]).epsilon(1e-6));
        CHECK(out[1][i] == doctest::Approx(2 * planes[1][i]).epsilon(1e-6));
        CHECK(out[2][i] == 0.25f);
      }
    }
  }
  CHECK_THROWS_AS(PlaneNetwork(path, 3, *oneDnn()), Error);
}

}  // namespace braid::test_window_cells
