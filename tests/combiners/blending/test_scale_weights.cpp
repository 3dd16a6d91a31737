// SPDX-License-Identifier: Apache-2.0
// Weights from errors at several scales: their matrices against plain loops, and who decides at how many samples.
#include <algorithm>
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include "combiners/ensemble/scale_weights.h"
#include "combiners/ensemble/scales/block_errors.h"
#include "combiners/ensemble/scales/error_scale.h"
#include "combiners/pixels/box_mean.h"

namespace braid::test_scale_weights {

namespace {

using Value = double (*)(int x, int y);

// An estimate whose mean is value(x, y) and whose halves have normal noise of this deviation.
Estimate noisy(int width, int height, Value value, double deviation, uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  Estimate e;
  e.passes = 4;
  e.mean = e.half[0] = e.half[1] = Rgb<float>(width, height);
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        for (Rgb<float>& half : e.half) half[c].at(x, y) = static_cast<float>(value(x, y) + deviation * normal(random));
        e.mean[c].at(x, y) = 0.5f * (e.half[0][c].at(x, y) + e.half[1][c].at(x, y));
      }
  return e;
}

// An estimate of 1 by samples of which few are bright, and its variance, which is 0 where none is.
Estimate withFireflies(int width, int height, double share, uint32_t seed) {
  std::mt19937 random(seed);
  std::bernoulli_distribution bright(share);
  Estimate e;
  e.passes = 4;
  e.mean = e.half[0] = e.half[1] = e.variance = Rgb<float>(width, height);
  for (size_t i = 0; i < e.mean.size(); ++i) {
    const float half[2] = {bright(random) ? static_cast<float>(1 / share) : 0.0f,
                           bright(random) ? static_cast<float>(1 / share) : 0.0f};
    for (size_t c = 0; c < 3; ++c) {
      for (size_t h = 0; h < 2; ++h) e.half[h][c][i] = half[h];
      e.mean[c][i] = 0.5f * (half[0] + half[1]);
      e.variance[c][i] = 0.25f * (half[0] - half[1]) * (half[0] - half[1]);
    }
  }
  return e;
}

double flat(int, int) { return 1; }
double brighter(int, int) { return 1.1; }
double rightLeft(int x, int) { return x < 80 ? 1 : 1.5; }
double rightRight(int x, int) { return x < 80 ? 1.5 : 1; }

}  // namespace

TEST_CASE("Errors of blocks are those of plain loops, at the borders too") {
  const int width = 11, height = 6;
  const Estimate x = noisy(width, height, flat, 0.5, 1), a = noisy(width, height, brighter, 0.1, 2),
                 b = noisy(width, height, rightRight, 0.2, 3);
  const std::vector<const Estimate*> both = {&a, &b};
  const Plane<float> roots = commonErrorRoots(both);
  for (const int half : {0, 1}) {
    const std::vector<Plane<float>> blocks = blockErrors(x, both, roots, half);
    REQUIRE(blocks.size() == 3);
    REQUIRE(blocks[0].width == 3);
    REQUIRE(blocks[0].height == 2);
    const auto error = [&](const Estimate& e, size_t c, int u, int v) {
      double sum = 0;
      for (const int dv : {-1, 0})
        for (const int du : {-1, 0}) {
          const int s = std::max(0, u + du), t = std::max(0, v + dv);
          sum += 0.25 *
                 (static_cast<double>(e.half[half][c].at(s, t)) - static_cast<double>(x.half[1 - half][c].at(s, t))) *
                 static_cast<double>(roots.at(s, t));
        }
      return sum;
    };
    for (int row = 0; row < 2; ++row)
      for (int column = 0; column < 3; ++column) {
        double sum = 0, count = 0;
        for (int v = 4 * row; v < std::min(height, 4 * row + 4); ++v)
          for (int u = 4 * column; u < std::min(width, 4 * column + 4); ++u, ++count)
            for (size_t c = 0; c < 3; ++c) sum += error(a, c, u, v) * error(b, c, u, v);
        CHECK(blocks[pairIndex(1, 0)].at(column, row) == doctest::Approx(sum / count).epsilon(1e-4));
      }
  }
}

TEST_CASE("The common brightness: a lamp's own, and the dark beside it") {
  Estimate e;
  e.mean = Rgb<float>(21, 21, 0.02f);
  for (size_t c = 0; c < 3; ++c) e.mean[c].at(10, 10) = 100;
  e.half[0] = e.half[1] = e.mean;
  Estimate leak = e;
  for (Rgb<float>* image : {&leak.mean, &leak.half[0], &leak.half[1]})
    for (size_t c = 0; c < 3; ++c) (*image)[c].at(11, 10) = 2;
  const Plane<float> roots = commonErrorRoots({&e, &leak});
  CHECK(roots.at(10, 10) == doctest::Approx(0.01).epsilon(0.01));  // 1 / 100
  CHECK(1 / roots.at(12, 10) < 0.15f);                             // not that of the lamp, two pixels off
  CHECK(1 / roots.at(11, 10) < 0.3f);                              // of 0.02 and 2: what leaks counts
}

TEST_CASE(
    "The common brightness of a pixel beside a lamp, bright by chance in one half, is no less than what is about it") {
  // The lamp fills the columns from 11 on; the pixel is of the lamp in one half and of the wall in the other.
  Estimate e;
  e.mean = e.half[0] = e.half[1] = Rgb<float>(21, 21, 0.2f);
  for (size_t c = 0; c < 3; ++c) {
    for (Rgb<float>* image : {&e.mean, &e.half[0], &e.half[1]})
      for (int y = 0; y < 21; ++y)
        for (int x = 11; x < 21; ++x) (*image)[c].at(x, y) = 10;
    e.half[1][c].at(10, 10) = 10;
    e.mean[c].at(10, 10) = 5.1f;
  }
  CHECK(1 / commonErrorRoots({&e}).at(10, 10) > 2.5f);
}

TEST_CASE("The common brightness does not rise where one half alone is bright, but no root is more than tripled") {
  Estimate e;
  e.mean = e.half[0] = e.half[1] = Rgb<float>(21, 21, 0.3f);
  const float before = commonErrorRoots({&e}).at(10, 10);
  const auto withBright = [&](float value) {
    for (size_t c = 0; c < 3; ++c) {
      e.half[1][c].at(10, 10) = value;
      e.mean[c].at(10, 10) = 0.5f * (0.3f + value);
    }
    return commonErrorRoots({&e}).at(10, 10);
  };
  CHECK(withBright(0.6f) == doctest::Approx(before).epsilon(1e-4));
  CHECK(withBright(9.7f) == doctest::Approx(3 / 5.0).epsilon(1e-3));
}

TEST_CASE("An image that lacks the light of rare samples does not win") {
  // The samples are 0, or rarely 50. What a filter has left of them is too dark, but bright about those that it met.
  const int width = 160, height = 96;
  const Estimate good = noisy(width, height, flat, 0.01, 2);
  for (uint32_t seed = 10; seed < 14; ++seed) {
    const Estimate x = withFireflies(width, height, 0.02, seed);
    Estimate dark = x;
    for (size_t c = 0; c < 3; ++c) {
      for (Rgb<float>& half : dark.half) {
        half[c] = boxMean<float>(half[c], 1);
        for (float& v : half[c].data) v = 0.3f + 0.35f * v;
      }
      for (size_t i = 0; i < x.mean.size(); ++i) dark.mean[c][i] = 0.5f * (dark.half[0][c][i] + dark.half[1][c][i]);
    }
    const WeightMaps w = scaleWeights(x, {&good, &dark}, nullptr);
    double mean = 0;
    for (const float v : w.of(0, 0).data) mean += static_cast<double>(v) / (width * height);
    CAPTURE(seed);
    CHECK(mean > 0.8);
  }
}

TEST_CASE("Without noise windows decide, under heavy noise the whole image does") {
  const int width = 160, height = 96;
  const Estimate left = noisy(width, height, rightLeft, 0.01, 2), right = noisy(width, height, rightRight, 0.01, 3);
  const auto weightAt = [&](double deviation, int x) {
    const Estimate samples = noisy(width, height, flat, deviation, 4);
    const WeightMaps w = scaleWeights(samples, {&left, &right}, nullptr);
    for (size_t i = 0; i < w.planes[0].size(); ++i)
      REQUIRE(w.planes[0][i] + w.planes[1][i] == doctest::Approx(1).epsilon(1e-4));
    return static_cast<double>(w.of(0, 0).at(x, height / 2));
  };
  CHECK(weightAt(0.01, 16) > 0.95);
  CHECK(weightAt(0.01, 144) < 0.05);
  CHECK(std::fabs(weightAt(100, 16) - weightAt(100, 144)) < 0.5);
}

TEST_CASE("From few samples the better of two images is found by the whole image") {
  // The noise is ten times the difference of the images. Their difference in squared error over the image, 0.01 in 1,
  // has a deviation of 0.2 / sqrt(3 * 160 * 96) for a pairing: a false alarm is beyond eight of them.
  const int width = 160, height = 96;
  const Estimate good = noisy(width, height, flat, 0.01, 2), bad = noisy(width, height, brighter, 0.01, 3);
  for (uint32_t seed = 10; seed < 20; ++seed) {
    const WeightMaps w = scaleWeights(noisy(width, height, flat, 1, seed), {&good, &bad}, nullptr);
    double mean = 0;
    for (const float v : w.of(0, 0).data) mean += static_cast<double>(v) / (width * height);
    CAPTURE(seed);
    CHECK(mean > 0.7);
  }
}

TEST_CASE("What few fireflies say of windows by chance makes no islands of the noisier image") {
  const int width = 320, height = 192, seeds = 4;
  const Estimate good = noisy(width, height, flat, 0.01, 2), bad = noisy(width, height, flat, 0.15, 3);
  const auto islands = [&](const Estimate& x) {
    const WeightMaps w = scaleWeights(x, {&good, &bad}, nullptr);
    const auto& ofBad = w.of(1, 0).data;
    return static_cast<double>(std::count_if(ofBad.begin(), ofBad.end(), [](float v) { return v > 0.4f; })) /
           static_cast<double>(ofBad.size() * seeds);
  };
  double with = 0, without = 0;
  for (uint32_t seed = 10; seed < 10 + seeds; ++seed) {
    Estimate x = withFireflies(width, height, 0.02, seed);
    with += islands(x);
    x.variance = {};
    without += islands(x);
  }
  // A fiftieth of the image where only the halves tell of noise.
  CHECK(without > 0.01);
  CHECK(with < 0.001);
}

TEST_CASE("Extreme images: finite weights on the simplex") {
  for (const double scale : {0.0, 1e-30, 1e30}) {
    Estimate x = noisy(5, 3, flat, 1, 1), y = noisy(5, 3, brighter, 0, 2);
    for (Estimate* e : {&x, &y})
      for (Rgb<float>* image : {&e->mean, &e->half[0], &e->half[1]})
        for (size_t c = 0; c < 3; ++c)
          for (float& v : (*image)[c].data) v = static_cast<float>(static_cast<double>(v) * scale);
    const WeightMaps w = scaleWeights(x, {&x, &y, &y}, nullptr);
    for (size_t i = 0; i < 15; ++i) {
      double sum = 0;
      for (const Plane<float>& plane : w.planes) {
        REQUIRE(std::isfinite(plane[i]));
        CHECK(plane[i] >= 0);
        sum += static_cast<double>(plane[i]);
      }
      CHECK(sum == doctest::Approx(1).epsilon(1e-4));
    }
  }
}

}  // namespace braid::test_scale_weights
