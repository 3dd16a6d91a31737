// SPDX-License-Identifier: Apache-2.0
// The quick picture of a preview: a quarter of the pixels that stand for all.
#include <doctest/doctest.h>

#include "tools/preview/half_size.h"

namespace braid::test_half_size {

namespace {

Rgb<float> ramp(int width, int height) {
  Rgb<float> image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (size_t c = 0; c < 3; ++c) image[c].at(x, y) = static_cast<float>(x + 10 * y) + static_cast<float>(c);
  return image;
}

Estimates ramps(int width, int height) {
  Estimates e;
  e.width = e.fullWidth = width;
  e.height = e.fullHeight = height;
  e.window = {0, 0, width, height};
  Estimate pt;
  pt.name = "pt";
  pt.passes = 1;
  pt.mean = pt.half[0] = ramp(width, height);
  pt.variance = Rgb<float>(width, height);
  for (size_t c = 0; c < 3; ++c) pt.variance[c] = Plane<float>(width, height, 8);
  e.estimates.push_back(pt);
  e.features.emplace();
  e.features->depth.mean = ramp(width, height)[0];
  return e;
}

}  // namespace

TEST_CASE("half size: means of the pixels that there are, and their variances") {
  const Estimates half = halfSize(ramps(5, 3));
  CHECK(half.width == 3);
  CHECK(half.height == 2);
  CHECK(half.window.width() == 3);
  const Estimate& pt = half.estimates.front();
  CHECK(pt.name == "pt");
  CHECK(pt.passes == 1);
  CHECK(pt.mean[0].at(0, 0) == 5.5f);   // of 0, 1, 10, 11
  CHECK(pt.mean[1].at(1, 0) == 8.5f);   // of 2, 3, 12, 13, and 1
  CHECK(pt.mean[0].at(2, 0) == 9);      // of 4 and 14
  CHECK(pt.mean[0].at(0, 1) == 20.5f);  // of 20 and 21
  CHECK(pt.mean[0].at(2, 1) == 24);
  CHECK(pt.half[0][2].at(0, 0) == 7.5f);
  CHECK(pt.half[1].empty());
  CHECK(pt.variance[0].at(0, 0) == 2);
  CHECK(pt.variance[0].at(2, 0) == 4);
  CHECK(pt.variance[0].at(2, 1) == 8);
  CHECK(half.features->depth.mean.at(0, 0) == 5.5f);
  CHECK(half.features->albedo.mean.empty());
}

TEST_CASE("double size: linear between pixels, and of any size") {
  const Rgb<float> whole = ramp(12, 10);
  Estimates e = ramps(12, 10);
  const Rgb<float> again = doubleSize(halfSize(e).estimates.front().mean, 12, 10);
  for (int y = 1; y < 9; ++y)
    for (int x = 1; x < 11; ++x) CHECK(again[0].at(x, y) == doctest::Approx(whole[0].at(x, y)));
  for (const auto& [width, height] : {std::pair(1, 1), {1, 7}, {7, 1}, {5, 3}}) {
    const Rgb<float> image = doubleSize(halfSize(ramps(width, height)).estimates.front().mean, width, height);
    CHECK(image.width() == width);
    CHECK(image.height() == height);
    CHECK(image[0].at(width - 1, height - 1) <= static_cast<float>(width - 1 + 10 * (height - 1)));
  }
}

}  // namespace braid::test_half_size
