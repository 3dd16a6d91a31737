// SPDX-License-Identifier: Apache-2.0
// The board that holds what a preview shows.
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include "tests/support/running_braid.h"
#include "tools/preview/preview_board.h"
#include "tests/tools/preview/half_floats.h"

namespace braid::test_preview_board {

using namespace test::half_floats;
using test::Json;
using test::sleepFor;

namespace {

Rgb<float> grey(int width, int height, float value) { return Rgb<float>(width, height, value); }

}  // namespace

TEST_CASE("The board's images hold the pixels, whatever the unit of light") {
  for (const float unit : {1e-12f, 1e-6f, 1.0f, 1e6f, 1e12f}) {
    INFO(unit);
    PreviewBoard board("scene", {}, {});
    Rgb<float> image(5, 3);
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < image.size(); ++i) image[c][i] = unit * (0.1f + 0.05f * static_cast<float>(3 * i + c));
    image[0][4] = std::numeric_limits<float>::quiet_NaN();
    image[1][5] = 0;
    board.show(1, 0.5, {&image});
    const auto shown = board.image("noisy");
    REQUIRE(shown);
    REQUIRE(shown->pixels.size() == 5 * 3 * 3 * 2);
    for (size_t i = 0; i < image.size(); ++i)
      for (size_t c = 0; c < 3; ++c) {
        const float value = std::ldexp(halfAt(shown->pixels, 3 * i + c), -shown->exponent);
        if (std::isnan(image[c][i]))
          CHECK(std::isnan(value));
        else
          CHECK(std::abs(value - image[c][i]) <= std::ldexp(image[c][i], -11));
      }
    CHECK(!board.image("combined"));
    CHECK(!board.image("error"));
  }
}

TEST_CASE("Error images are relative, and older images replace no newer ones") {
  PreviewBoard board("scene", {}, {});
  const Rgb<float> image = grey(2, 2, 0.5f);
  const Plane<float> error(2, 2, 0.26f * 0.04f), half(2, 2, 0.26f * 0.01f);
  board.show(8, 1, {&image, nullptr, &error, nullptr});
  CHECK(halfAt(board.image("error")->pixels, 3) == doctest::Approx(0.2).epsilon(1e-3));
  CHECK(board.state()["estimatedError"]["noisy"].get<double>() == doctest::Approx(0.04));
  board.show(8, 1, {nullptr, &image, nullptr, &half});
  CHECK(halfAt(board.image("error")->pixels, 0) == doctest::Approx(0.1).epsilon(1e-3));
  CHECK(halfAt(board.image("noisy-error")->pixels, 0) == doctest::Approx(0.2).epsilon(1e-3));
  CHECK(board.state()["estimatedError"]["combined"].get<double>() == doctest::Approx(0.01));
  const Rgb<float> old = grey(2, 2, 7);
  board.show(4, 0.5, {&old, &old, &half, &half});
  CHECK(board.image("noisy")->spp == 8);
  CHECK(halfAt(board.image("combined")->pixels, 0) == 0.5f);
  CHECK(board.state()["history"]["noisy"].size() == 1);
}

TEST_CASE("The history of a long preview stays short and keeps its newest point") {
  PreviewBoard board("scene", {}, {});
  const Rgb<float> image = grey(1, 1, 1);
  const Plane<float> error(1, 1, 1);
  uint64_t spp = 0;
  for (double t = 0.25; t < 20000; t += 1) board.show(++spp, t, {&image, nullptr, &error, nullptr});
  const Json history = board.state()["history"]["noisy"];
  CHECK(history.size() < 600);
  CHECK(history.size() > 100);
  CHECK(history.back()[1] == spp);
  for (size_t i = 1; i < history.size(); ++i) CHECK(history[i][0] > history[i - 1][0]);
}

TEST_CASE("Waiting for a change ends with one, with the time, and when the board closes") {
  PreviewBoard board("scene", {}, {});
  const auto seconds = [&](uint64_t version, double limit) {
    const auto start = std::chrono::steady_clock::now();
    board.waitForChange(version, limit);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  const uint64_t version = board.state()["version"];
  CHECK(seconds(version + 1, 10) < 1);
  CHECK(seconds(version, 0.1) >= 0.09);
  std::thread later([&] {
    sleepFor(0.1);
    board.warn("something");
  });
  CHECK(seconds(version, 20) < 10);
  later.join();
  CHECK(board.state()["warnings"] == Json::array({"something"}));
  board.close();
  CHECK(seconds(board.state()["version"], 20) < 10);
}

}  // namespace braid::test_preview_board
