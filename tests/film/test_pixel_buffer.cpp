// SPDX-License-Identifier: Apache-2.0
// The memory of planes: values, copies, and that reuse of freed buffers is never seen.
#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "renderer/core/plane.h"

namespace braid::test_pixel_buffer {

namespace {

constexpr int kWidth = 1024;
// Of the heap, of the smallest and of larger mapped buffers.
constexpr int kHeights[] = {1, 255, 256, 700, 20000};

bool all(const Plane<float>& plane, float value) {
  return std::all_of(plane.data.begin(), plane.data.end(), [&](float v) { return v == value; });
}

}  // namespace

TEST_CASE("A plane holds the value that it was made with, also where another one was freed before") {
  for (const int height : kHeights) {
    CAPTURE(height);
    for (int round = 0; round < 3; ++round) {
      { const Plane<float> used(kWidth, height, 7); }
      CHECK(all(Plane<float>(kWidth, height), 0));
      CHECK(all(Plane<float>(kWidth, height, 0.5f), 0.5f));
      Plane<float> written(kWidth, height, kUnfilled);
      CHECK(written.size() == static_cast<size_t>(kWidth) * static_cast<size_t>(height));
      std::fill(written.data.begin(), written.data.end(), 3.0f);
      CHECK(all(written, 3));
    }
  }
}

TEST_CASE("Copies of planes are their own, whatever the size that they replace, and moves leave nothing behind") {
  for (const int height : kHeights) {
    CAPTURE(height);
    Plane<float> a(kWidth, height, 2), b = a, c(3, 3, 5);
    b[7] = 4;
    CHECK(all(a, 2));
    c = a;
    CHECK(c.data == a.data);
    CHECK_FALSE(c.data == b.data);
    c = b;
    CHECK(c[7] == 4);
    const Plane<float>& same = c;
    c = same;
    CHECK(c[7] == 4);
    const Plane<float> moved = std::move(c);
    CHECK(moved.data == b.data);
    CHECK(c.empty());  // NOLINT: what is left is the point
    b = {};
    CHECK(b.empty());
    CHECK_FALSE(b.data == a.data);
  }
  CHECK(Plane<float>().empty());
}

TEST_CASE("Buffers that live at once never share memory, and lie as vectors want them") {
  std::vector<Plane<double>> planes;
  for (int round = 0; round < 2; ++round) {
    planes.clear();
    for (int k = 0; k < 12; ++k) planes.emplace_back(kWidth, 256, static_cast<double>(k));
    for (int k = 0; k < 12; ++k) {
      const Plane<double>& p = planes[static_cast<size_t>(k)];
      CHECK(reinterpret_cast<std::uintptr_t>(p.data.data()) % 64 == 0);
      CHECK(std::all_of(p.data.begin(), p.data.end(), [&](double v) { return v == k; }));
    }
  }
}

TEST_CASE("A freed buffer serves smaller ones, each with a part of its own, until all is given back") {
  dropKeptPixels();
  const float *begin = nullptr, *end = nullptr;
  {
    const Plane<float> large(kWidth, 1000, 1);
    begin = large.data.begin();
    end = large.data.end();
  }
  std::vector<Plane<float>> parts;
  for (const int height : {256, 300, 300}) parts.emplace_back(kWidth, height, static_cast<float>(parts.size()));
  for (size_t k = 0; k < parts.size(); ++k) {
    CHECK(parts[k].data.begin() >= begin);
    CHECK(parts[k].data.end() <= end);
    CHECK(all(parts[k], static_cast<float>(k)));
  }
  parts.clear();
  dropKeptPixels();
  CHECK(all(Plane<float>(kWidth, 1000), 0));
}

}  // namespace braid::test_pixel_buffer
