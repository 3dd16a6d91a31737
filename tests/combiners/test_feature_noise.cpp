// SPDX-License-Identifier: Apache-2.0
// Noise of the features in images of few samples: what is averaged, what is left alone, and extreme values.
#include <atomic>
#include <cmath>
#include <limits>
#include <random>

#include <doctest/doctest.h>

#include "combiners/auto/feature_noise.h"
#include "tests/combiners/auto_cases.h"

namespace braid::test_feature_noise {

using namespace test;
using namespace test::auto_cases;

namespace {

constexpr int kWidth = 64, kHeight = 48;
constexpr float kBright = 0.7f, kDark = 0.1f;

// Features of two surfaces, the bright one where `bright(x, y)`; their variance is that given.
template <class Bright>
Features featuresOf(const Bright& bright, float variance = 0) {
  Features f;
  f.albedo.mean = f.normal.mean = Rgb<float>(kWidth, kHeight);
  f.albedo.variance = f.normal.variance = Rgb<float>(kWidth, kHeight, variance);
  f.depth.mean = Plane<float>(kWidth, kHeight, 3.0f);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const bool b = bright(x, y);
      f.albedo.mean.set(f.depth.mean.index(x, y), Spectrum(b ? kBright : kDark));
      f.normal.mean.set(f.depth.mean.index(x, y), b ? Vec3(0, 0, 1) : Vec3(0, 1, 0));
    }
  return f;
}

// What filters make of even light of 1.
Estimate evenlyLit(const Features& f) {
  Estimate e;
  e.mean = e.half[0] = e.half[1] = f.albedo.mean;
  return e;
}

Estimate averaged(const Features& f, uint64_t passes, const Plane<float>& own = {}) {
  Estimate e = evenlyLit(f);
  averageFeatureNoise(e, &f, passes, own);
  return e;
}

// Each pixel shows the bright surface with this probability.
Features speckled(double probability, float variance = 0, uint32_t seed = 7) {
  std::mt19937 random(seed);
  std::bernoulli_distribution bright(probability);
  return featuresOf([&](int, int) { return bright(random); }, variance);
}

double squaredError(const Plane<float>& image, double truth) {
  double sum = 0;
  for (const float v : image.data) sum += std::pow(static_cast<double>(v) - truth, 2);
  return sum / static_cast<double>(image.size());
}

bool same(const Rgb<float>& a, const Rgb<float>& b) {
  return a[0].data == b[0].data && a[1].data == b[1].data && a[2].data == b[2].data;
}

}  // namespace

TEST_CASE("Speckles of surfaces that share all pixels are averaged, in the image and in its halves") {
  Features f = speckled(0.5);
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uniform(0.1f, 0.9f);
  for (size_t i = 0; i < f.albedo.mean.size(); ++i) f.albedo.mean.set(i, Spectrum(uniform(random)));
  const Estimate e = averaged(f, 1);
  CHECK(squaredError(e.mean[0], 0.5) < 0.5 * squaredError(f.albedo.mean[0], 0.5));
  CHECK(same(e.half[0], e.mean));
  CHECK(same(e.half[1], e.mean));
  for (const double p : {0.3, 0.5, 0.8}) {  // of two only, which are alike in some direction by chance
    const double truth = p * static_cast<double>(kBright) + (1 - p) * static_cast<double>(kDark);
    CAPTURE(p);
    CHECK(squaredError(averaged(speckled(p), 1).mean[0], truth) <
          0.8 * squaredError(speckled(p).albedo.mean[0], truth));
  }
}

TEST_CASE("Clean edges stay as they are, in every direction") {
  const auto alike = [](const auto& bright) {
    const Features f = featuresOf(bright);
    const Estimate e = averaged(f, 1);
    bool all = true;
    for (int y = 1; y < kHeight - 1; ++y)  // at the border of the image half of an edge is missing
      for (int x = 1; x < kWidth - 1; ++x) all &= e.mean[0].at(x, y) == f.albedo.mean[0].at(x, y);
    return all;
  };
  CHECK(alike([](int x, int) { return x < 20; }));
  CHECK(alike([](int, int y) { return y < 20; }));
  CHECK(alike([](int x, int y) { return x + y < 40; }));
  CHECK(alike([](int x, int y) { return x - y < 10; }));
  CHECK(alike([](int x, int) { return x % 4 < 2; }));
}

TEST_CASE("Stripes with jagged edges are averaged lengthwise: they lose the teeth and keep the contrast") {
  std::mt19937 random(3);
  std::bernoulli_distribution half(0.5);
  const auto jagged = [&](int x, int) { return x % 8 == 0 ? half(random) : x % 8 < 4; };
  const Features f = featuresOf(jagged);
  const Estimate e = averaged(f, 1);
  double teeth = 0, contrast = 0;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; x += 8) {
      teeth += std::pow(static_cast<double>(e.mean[0].at(x, y)) - 0.4, 2) / (kHeight * kWidth / 8);
      contrast += static_cast<double>(e.mean[0].at(x + 2, y) - e.mean[0].at(x + 6, y)) / (kHeight * kWidth / 8);
    }
  CHECK(teeth < 0.6 * 0.09);  // of pixels that are 0.3 from the middle
  CHECK(contrast > 0.99 * static_cast<double>(kBright - kDark));
}

TEST_CASE("From two passes on what differs by more than the features' noise is detail") {
  const Rgb<float> detail = speckled(0.5).albedo.mean;
  CHECK(same(averaged(speckled(0.5), 2).mean, detail));
  CHECK_FALSE(same(averaged(speckled(0.5, 0.02f), 2).mean, detail));
  const auto change = [&](uint64_t passes) {
    return squaredError(averaged(speckled(0.5, 0.02f), passes).mean[0], static_cast<double>(kBright + kDark) / 2);
  };
  CHECK(change(2) < change(4));
  CHECK(change(4) < change(100));
  Features unknown = speckled(0.5);
  unknown.albedo.variance = {};
  CHECK(same(averaged(unknown, 2).mean, detail));
}

TEST_CASE("What is not a filter's own, an environment seen directly, and an image without features stay") {
  const Features f = speckled(0.5);
  CHECK(same(averaged(f, 1, Plane<float>(kWidth, kHeight, 0.0f)).mean, f.albedo.mean));
  Features sky = f;
  sky.depth.mean = Plane<float>(kWidth, kHeight, 0.0f);
  sky.normal.mean = Rgb<float>(kWidth, kHeight, 1.0f);
  CHECK(same(averaged(sky, 1).mean, sky.albedo.mean));
  Estimate e = evenlyLit(f);
  averageFeatureNoise(e, nullptr, 1, {});
  Features none;
  averageFeatureNoise(e, &none, 1, {});
  const std::atomic<bool> cancel = true;
  averageFeatureNoise(e, &f, 1, {}, &cancel);
  CHECK(same(e.mean, f.albedo.mean));
}

TEST_CASE("A lamp lights what is beside it by no more than that has") {
  const Features f = speckled(0.5);
  Estimate e = evenlyLit(f);
  for (size_t c = 0; c < 3; ++c) e.mean[c].at(30, 20) = 5000;
  averageFeatureNoise(e, &f, 1, {});
  for (const auto& [x, y] : {std::pair{29, 20}, std::pair{31, 21}, std::pair{30, 19}})
    CHECK(e.mean[0].at(x, y) <= 2.001f * f.albedo.mean[0].at(x, y));
}

TEST_CASE("Values that are extreme, not finite or alone give finite images where they were") {
  Features f = speckled(0.5, std::numeric_limits<float>::infinity());
  f.albedo.mean[0].at(3, 3) = std::numeric_limits<float>::quiet_NaN();
  f.normal.mean[1].at(9, 3) = std::numeric_limits<float>::infinity();
  f.albedo.variance[1].at(12, 3) = -1;
  for (const float scale : {0.0f, 1e-30f, 1.0f, 1e30f, -1.0f})
    for (const uint64_t passes : {1, 2, 7}) {
      Estimate e;
      e.mean = e.half[0] = e.half[1] = Rgb<float>(kWidth, kHeight, scale);
      averageFeatureNoise(e, &f, passes, {});
      CAPTURE(scale);
      for (const float v : e.mean[0].data) CHECK((std::isfinite(v) && std::abs(v - scale) <= 1e-5f * std::abs(scale)));
    }
  Features dot;
  dot.albedo.mean = dot.normal.mean = Rgb<float>(1, 1, 0.5f);
  Estimate e;
  e.mean = Rgb<float>(1, 1, 3.0f);
  averageFeatureNoise(e, &dot, 1, {});
  CHECK(e.mean[0][0] == 3.0f);
}

TEST_CASE("auto averages noise of the features below 8 passes, but not what a named denoiser makes of a single one") {
  for (const uint64_t samples : {1, 2, 7, 8}) {
    Case c = noisyCase(samples);
    Estimates e = kept(c, {"pt"});
    std::mt19937 random(5);
    std::uniform_real_distribution<float> uniform(0.1f, 0.9f);
    for (float& v : e.features->albedo.mean[0].data) v = uniform(random);
    e.features->albedo.variance = Rgb<float>(e.width, e.height, 0.05f);
    const auto image = [&](double on, std::vector<std::string> denoisers) {
      PipelineOptions options;
      options.numbers.set("auto-feature-noise", on);
      options.roles.denoisers = std::move(denoisers);
      return outputOf(e, "auto", options).result.image.mean;
    };
    CAPTURE(samples);
    CHECK(same(image(1, {}), image(0, {})) == (samples == 8));
    if (samples == 1) CHECK(same(image(1, {"nlm"}), image(0, {"nlm"})));
  }
}

}  // namespace braid::test_feature_noise
