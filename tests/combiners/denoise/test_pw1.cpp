// SPDX-License-Identifier: Apache-2.0
// The first-order patch-Welch filter: its fits against plain double-precision ones, and what the blend with the
// zero-order result is for.
#include <array>
#include <cmath>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/denoise/pw/pw1_filter.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/plain_window.h"

namespace braid::test_pw1 {

using namespace test;

namespace {

struct Filtered {
  std::vector<Rgb<float>> zeroOrder, firstOrder;
};

Filtered filtered(const Estimate& e, const Features* features, FirstOrderOptions options = {}) {
  const PatchWelchInput input = patchWelchInput(e, features);
  Filtered out;
  out.zeroOrder = patchWelch(input, std::array{options.threshold})[0];
  out.firstOrder = patchWelchFirstOrder(input, options);
  return out;
}

// A smooth scene without features: gentle waves, noise of known variance, 16 passes.
Estimate smoothEstimate(const Rgb<float>& truth, float sd, uint64_t seed) {
  Estimate e;
  e.passes = 16;
  e.mean = truth;
  e.variance = Rgb<float>(truth.width(), truth.height(), sd * sd);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < truth.size(); ++i) {
      double noise = -6;  // twelve uniform variates: nearly normal, variance 1
      for (uint64_t k = 0; k < 12; ++k) noise += detail::uniform(seed, c, k, i);
      e.mean[c][i] += sd * static_cast<float>(noise);
    }
  return e;
}

Rgb<float> waves(int width, int height) {
  Rgb<float> image(width, height);
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        image[c].at(x, y) = 2 + std::sin(0.05f * static_cast<float>(x)) + 0.02f * static_cast<float>(y);
  return image;
}

// The filter in double for one image without features: weights, fits at the centres, blend.
class PlainFit {
 public:
  PlainFit(const PatchWelchInput& input, size_t image, const FirstOrderOptions& options)
      : mean_(*input.images[image]), variance_(input.variance), factor_(image == 0 ? 1 : 2), options_(options) {
    t2_ = sqr(studentQuantile(options.threshold, 2 * input.passes - 2));
  }

  double at(int x, int y, size_t channel, double zeroOrder) const {
    const double kappa = static_cast<double>(options_.kappa);
    double total = kappa, sum = kappa * zeroOrder;
    for (int v = 0; v < mean_.height(); v += options_.stride)
      for (int u = 0; u < mean_.width(); u += options_.stride) {
        if (!inPlainWindow(u - x, v - y)) continue;
        const double w = weight(u, v, x, y);
        total += w;
        sum += w * prediction(u, v, x, y, channel);
      }
    return sum / total;
  }

 private:
  bool inside(int x, int y) const { return x >= 0 && y >= 0 && x < mean_.width() && y < mean_.height(); }

  double weight(int x, int y, int u, int v) const {
    double s = 0, count = 0;
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        if (!inside(x + i, y + j) || !inside(u + i, v + j)) continue;
        for (size_t c = 0; c < 3; ++c) {
          const double d =
              static_cast<double>(mean_[c].at(x + i, y + j)) - static_cast<double>(mean_[c].at(u + i, v + j));
          const double spread =
              static_cast<double>(variance_[c].at(x + i, y + j)) + static_cast<double>(variance_[c].at(u + i, v + j));
          s += d * d / (factor_ * spread);
        }
        count += 3;
      }
    return sqr(std::max(0.0, 1 - s / count / t2_)) * std::exp(-(sqr(x - u) + sqr(y - v)) / 50.0);
  }

  // The fit around (cx, cy), at (x, y): [1, dx/8, dy/8] with a ridge on the slopes; the other columns vanish.
  double prediction(int cx, int cy, int x, int y, size_t channel) const {
    double m[3][4] = {};
    for (int v = cy - 8; v <= cy + 8; ++v)
      for (int u = cx - 8; u <= cx + 8; ++u) {
        if (!inside(u, v) || !inPlainWindow(u - cx, v - cy)) continue;
        const double w = weight(cx, cy, u, v), row[3] = {1, (u - cx) / 8.0, (v - cy) / 8.0};
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) m[i][j] += w * row[i] * row[j];
          m[i][3] += w * row[i] * static_cast<double>(mean_[channel].at(u, v));
        }
      }
    const double ridge = 1e-2 * m[0][0];
    m[1][1] += ridge;
    m[2][2] += ridge;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k)
        if (k != i)
          for (int j = 3; j >= i; --j) m[k][j] -= m[i][j] * m[k][i] / m[i][i];
    return m[0][3] / m[0][0] + m[1][3] / m[1][1] * (x - cx) / 8 + m[2][3] / m[2][2] * (y - cy) / 8;
  }

  const Rgb<float>&mean_, &variance_;
  double factor_;
  FirstOrderOptions options_;
  double t2_;
};

// A dark image with noise of known variance, and bright pixels where no centre lies.
Estimate withBrightPixels(const std::vector<std::array<int, 2>>& pixels) {
  Estimate e = smoothEstimate(Rgb<float>(64, 64, 1.0f), 0.05f, 3);
  for (const auto& [x, y] : pixels)
    for (size_t c = 0; c < 3; ++c) e.mean[c].at(x, y) += 50;
  return e;
}

}  // namespace

TEST_CASE("The first-order filter is what its formula says") {
  for (const auto& [width, height] : {std::array{1, 1}, {7, 3}, {31, 22}}) {
    Case c = caseOf(width, height, 16);
    const PatchWelchInput input = patchWelchInput(c.pt(), nullptr);
    const Filtered out = filtered(c.pt(), nullptr);
    for (size_t image = 0; image < 3; ++image) {
      const PlainFit plain(input, image, {});
      double worst = 0;
      for (int y = 0; y < height; y += 3)
        for (int x = 0; x < width; x += 2) {
          const double expected = plain.at(x, y, 1, static_cast<double>(out.zeroOrder[image][1].at(x, y)));
          const double got = static_cast<double>(out.firstOrder[image][1].at(x, y));
          worst = std::max(worst, std::fabs(got - expected) / (std::fabs(expected) + 1e-3));
        }
      CAPTURE(width);
      CHECK(worst < 1e-3);
    }
  }
}

TEST_CASE("A constant image is invariant under the first-order filter") {
  for (const float variance : {0.0f, 1.0f}) {
    Estimate e;
    e.passes = 16;
    e.mean = Rgb<float>(45, 30, 0.7f);
    e.variance = Rgb<float>(45, 30, variance);
    const Filtered out = filtered(e, nullptr);
    for (const float v : out.firstOrder[0][0].data) CHECK(v == doctest::Approx(0.7f).epsilon(1e-5));
  }
}

TEST_CASE("What a feature explains linearly comes out better from the first-order filter") {
  // The radiance follows the depth through a zigzag that no polynomial in x and y follows.
  Rgb<float> truth(96, 64);
  Features f;
  f.albedo.mean = f.normal.mean = Rgb<float>(96, 64, 0.5f);
  f.depth.mean = f.visibility.mean = Plane<float>(96, 64);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 96; ++x) {
      f.depth.mean.at(x, y) = 4 + static_cast<float>(std::abs(x % 14 - 7)) / 3.5f;
      for (size_t c = 0; c < 3; ++c) truth[c].at(x, y) = 0.5f * f.depth.mean.at(x, y);
    }
  double zero = 0, first = 0;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const Filtered out = filtered(smoothEstimate(truth, 0.3f, seed), &f);
    zero += meanSquaredError(out.zeroOrder[0], truth);
    first += meanSquaredError(out.firstOrder[0], truth);
  }
  CAPTURE(first / zero);
  CHECK(first < 0.7 * zero);
}

TEST_CASE("Glints and thin lines between the centres come out as the zero-order result, not as the input") {
  SUBCASE("an isolated glint") {
    const Estimate e = withBrightPixels({{33, 34}});
    const Filtered out = filtered(e, nullptr);
    CHECK(out.firstOrder[0][0].at(33, 34) == doctest::Approx(out.zeroOrder[0][0].at(33, 34)).epsilon(1e-6));
  }
  SUBCASE("a thin line, which the zero-order filter smooths along its length") {
    std::vector<std::array<int, 2>> line;
    for (int y = 0; y < 64; ++y) line.push_back({33, y});
    const Estimate e = withBrightPixels(line);
    const Filtered out = filtered(e, nullptr);
    double raw = 0, result = 0;
    for (const auto& [x, y] : line) {
      CHECK(out.firstOrder[0][0].at(x, y) == doctest::Approx(out.zeroOrder[0][0].at(x, y)).epsilon(1e-6));
      raw += sqr(static_cast<double>(e.mean[0].at(x, y)) - 51);
      result += sqr(static_cast<double>(out.firstOrder[0][0].at(x, y)) - 51);
    }
    CHECK(result < 0.3 * raw);
  }
}

TEST_CASE("Centres five pixels apart are as good as one at every pixel") {
  // The sum of the weights grows with the number of centres; kappa grows along for the same share of the zero-order
  // result.
  for (const float sd : {0.15f, 0.3f, 1.0f}) {
    double error[2] = {0, 0};
    for (uint64_t seed = 1; seed <= 3; ++seed) {
      const Rgb<float> truth = waves(96, 72);
      const Estimate e = smoothEstimate(truth, sd, seed);
      for (const int stride : {1, 5}) {
        FirstOrderOptions options;
        options.stride = stride;
        options.kappa = 20.0f / static_cast<float>(stride * stride);
        error[stride == 5] += meanSquaredError(filtered(e, nullptr, options).firstOrder[0], truth) / 3;
      }
    }
    CAPTURE(sd);
    CAPTURE(error[1] / error[0]);
    CHECK(error[1] < 1.05 * error[0]);
    CHECK(error[1] < 0.03 * sqr(static_cast<double>(sd)));
  }
}

TEST_CASE("Four times the samples shrink the error of the first-order filter" * doctest::test_suite("statistics")) {
  double last = kInfinity;
  for (const uint64_t samples : {16, 64, 256}) {
    const Case c = caseOf(96, 72, samples);
    const double error = meanSquaredError(filtered(c.pt(), &*c.estimates.features).firstOrder[0], c.truth);
    CHECK(error < 0.6 * last);
    CHECK(error < 0.25 * meanSquaredError(c.pt().mean, c.truth));
    last = error;
  }
}

TEST_CASE("Neither tiles nor threads change a bit of the first-order filter") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Case c = caseOf(257, 89, 8);
  const Filtered usual = filtered(c.pt(), &*c.estimates.features);
  for (const int tile : {13, 64, 300}) {
    FirstOrderOptions options;
    options.tileSize = tile;
    const Filtered other = filtered(c.pt(), &*c.estimates.features, options);
    for (size_t i = 0; i < 3; ++i) CHECK(identical(usual.firstOrder[i], other.firstOrder[i]));
  }
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    const Filtered other = arena.execute([&] { return filtered(c.pt(), &*c.estimates.features); });
    for (size_t i = 0; i < 3; ++i) CHECK(identical(usual.firstOrder[i], other.firstOrder[i]));
  }
}

}  // namespace braid::test_pw1
