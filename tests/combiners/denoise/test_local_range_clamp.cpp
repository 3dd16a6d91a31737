// SPDX-License-Identifier: Apache-2.0
// The range that filtered pixels are kept in: of those whose samples have missed the light, beside lamps, along lines.
#include <array>
#include <limits>

#include <doctest/doctest.h>

#include "combiners/statistics/local_range_clamp.h"

namespace braid::test_local_range_clamp {

namespace {

constexpr int kSize = 15, kMiddle = 7;

// An image of one value, its noise and what a filter made of it.
struct Kept {
  Rgb<float> noisy{kSize, kSize, 0.5f}, variance{kSize, kSize, 0.015f}, filtered{kSize, kSize, 0.5f};

  void set(int x, int y, float value, float v) {
    for (size_t c = 0; c < 3; ++c) {
      noisy[c].at(x, y) = value;
      variance[c].at(x, y) = v;
    }
  }
  float at(int x, int y) {
    clampToLocalRange(std::array{&filtered}, std::array<const Rgb<float>*, 1>{&noisy}, noisy, variance, 2);
    return filtered[1].at(x, y);
  }
};

}  // namespace

TEST_CASE("A pixel whose samples have all missed the light is not held down") {
  Kept wall;
  wall.set(kMiddle, kMiddle, 0.15f, 1e-4f);
  CHECK(wall.at(kMiddle, kMiddle) == doctest::Approx(0.5f));
}

TEST_CASE("A pixel that stands further out than 3.5 deviations is held, alone or not") {
  Kept wall;
  wall.set(kMiddle, kMiddle, 0.05f, 1e-4f);
  CHECK(wall.at(kMiddle, kMiddle) == doctest::Approx(0.055f));
}

TEST_CASE("Pixels beside a lamp and those of a thin line stay dark") {
  Kept lamp;
  lamp.noisy = Rgb<float>(kSize, kSize, 0.01f);
  lamp.variance = Rgb<float>(kSize, kSize, 1e-6f);
  lamp.set(kMiddle, kMiddle, 100, 2000);  // as if half of its samples saw it
  lamp.filtered = Rgb<float>(kSize, kSize, 5.0f);
  CHECK(lamp.at(kMiddle + 1, kMiddle) <= 0.0111f);

  Kept line;
  for (int y = 0; y < kSize; ++y) line.set(kMiddle, y, 0.15f, 1e-4f);
  CHECK(line.at(kMiddle, kMiddle) <= 0.166f);
}

TEST_CASE("Values that are no numbers of a picture leave finite ones") {
  Kept wall;
  constexpr float kMost = std::numeric_limits<float>::max();
  wall.set(0, 0, kMost, kMost);
  wall.set(1, 0, -kMost, 0);
  wall.set(kMiddle, kMiddle, 0, 0);
  for (const auto& [x, y] : {std::array{0, 0}, {1, 0}, {kMiddle, kMiddle}}) CHECK(wall.at(x, y) == wall.at(x, y));
}

}  // namespace braid::test_local_range_clamp
