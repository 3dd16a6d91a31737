// SPDX-License-Identifier: Apache-2.0
// Noise of the albedo in images that were divided and multiplied by it: through glass, at edges, and in extreme values.
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include <doctest/doctest.h>

#include "combiners/auto/albedo_noise.h"
#include "combiners/auto/settled_albedo.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pipeline/pipeline.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_settled_albedo {

using namespace test;

namespace {

constexpr int kWidth = 64, kHeight = 48;
constexpr uint64_t kPasses = 4;
constexpr float kIrradiance = 2;
const Rgb<float> kNoisy(kWidth, kHeight, 1.0f);  // the variance of samples that allow any change

// Features whose albedo is the mean of what `sample(x, y, u)` is for one random number u a pass, of all channels alike.
template <class Sample>
Features featuresOf(const Sample& sample, uint32_t seed) {
  Features f;
  f.albedo.mean = f.albedo.variance = Rgb<float>(kWidth, kHeight);
  f.depth.mean = Plane<float>(kWidth, kHeight, 3.0f);
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      float sum = 0, squares = 0;
      for (uint64_t k = 0; k < kPasses; ++k) {
        const float a = sample(x, y, uniform(random));
        sum += a;
        squares += a * a;
      }
      constexpr auto n = static_cast<float>(kPasses);
      for (size_t c = 0; c < 3; ++c) {
        f.albedo.mean[c].at(x, y) = sum / n;
        f.albedo.variance[c].at(x, y) = std::max(0.0f, (squares - sum * sum / n) / (n * (n - 1)));
      }
    }
  return f;
}

// What filters leave of even light: the albedo of the samples times the irradiance.
Estimate evenlyLit(const Features& f) {
  Estimate e;
  e.mean = f.albedo.mean;
  for (Plane<float>& plane : e.mean.channel)
    for (float& v : plane.data) v *= kIrradiance;
  e.half[0] = e.half[1] = e.mean;
  return e;
}

// The albedo so many standard deviations off.
Rgb<float> shiftedAlbedo(const Features& f, float deviations) {
  Rgb<float> out = f.albedo.mean;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < out.size(); ++i) out[c][i] += deviations * std::sqrt(f.albedo.variance[c][i]);
  return out;
}

double squaredError(const Rgb<float>& image, float truth) {
  double sum = 0;
  for (const float v : image[0].data) sum += std::pow(static_cast<double>(v - truth), 2);
  return sum;
}

}  // namespace

TEST_CASE("Noise of what is seen in glass or mirrored by it goes, in the image and its halves") {
  const auto glass = [](int, int, float u) { return u < 0.25f ? 0.1f : 0.7f; };
  const Features f = featuresOf(glass, 1);
  Estimate e = evenlyLit(f);
  const float truth = kIrradiance * (0.25f * 0.1f + 0.75f * 0.7f);
  const double before = squaredError(e.mean, truth);
  settleAlbedo(e, kNoisy, &f, kPasses);
  CHECK(squaredError(e.mean, truth) < 0.3 * before);
  CHECK(squaredError(e.half[1], truth) < 0.3 * before);
}

TEST_CASE("Where the albedo has no noise no bit changes, and edges stay between its surfaces") {
  const auto edge = [](int x, int, float u) { return x < 20 || (x == 20 && u < 0.5f) ? 0.2f : 0.8f; };
  const Features f = featuresOf(edge, 2);
  const Estimate before = evenlyLit(f);
  Estimate e = before;
  settleAlbedo(e, kNoisy, &f, kPasses);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const float was = before.mean[0].at(x, y), is = e.mean[0].at(x, y);
      if (x < 17 || x > 23)
        CHECK(is == doctest::Approx(was).epsilon(1e-6));
      else if (x != 20)
        CHECK(is == doctest::Approx(was).epsilon(0.02));
      else
        CHECK((is >= 0.4f * 0.99f && is <= 1.6f * 1.01f));
    }

  const Features exact = featuresOf([](int x, int, float) { return x % 2 ? 0.3f : 0.5f; }, 3);
  Features none = exact;
  for (Plane<float>& plane : none.albedo.variance.channel) std::fill(plane.data.begin(), plane.data.end(), 0.0f);
  Estimate same = evenlyLit(none);
  settleAlbedo(same, kNoisy, &none, kPasses);
  CHECK(same.mean[0].data == evenlyLit(none).mean[0].data);
  settleAlbedo(same, kNoisy, nullptr, kPasses);
  none.albedo.variance = {};
  settleAlbedo(same, kNoisy, &none, kPasses);
  CHECK(same.mean[0].data == evenlyLit(none).mean[0].data);
}

TEST_CASE("No value changes by more than two standard deviations of the samples") {
  const Features f = featuresOf([](int, int, float u) { return u < 0.25f ? 0.1f : 0.7f; }, 6);
  const Estimate before = evenlyLit(f);
  Estimate still = before, little = before;
  settleAlbedo(still, Rgb<float>(kWidth, kHeight), &f, kPasses);
  CHECK(still.mean[0].data == before.mean[0].data);
  settleAlbedo(little, Rgb<float>(kWidth, kHeight, 1e-4f), &f, kPasses);
  float most = 0;
  for (size_t i = 0; i < before.mean.size(); ++i)
    most = std::max(most, std::fabs(little.mean[2][i] - before.mean[2][i]));
  CHECK(most == doctest::Approx(0.02f).epsilon(1e-3));
}

TEST_CASE("Misses, emitters and values that are no numbers stay as they are, and spoil nothing about them") {
  const auto glass = [](int, int, float u) { return u < 0.25f ? 0.1f : 0.7f; };
  Features f = featuresOf(glass, 4);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinite = std::numeric_limits<float>::infinity();
  const float strange[] = {kNan, kInfinite, -kInfinite, 40, std::numeric_limits<float>::max()};
  for (int i = 0; i < 5; ++i)
    for (size_t c = 0; c < 3; ++c) f.albedo.mean[c].at(8 + 8 * i, 20) = strange[i];
  f.depth.mean.at(5, 5) = 0;
  f.albedo.variance[0].at(30, 30) = kInfinite;
  f.albedo.variance[1].at(31, 30) = kNan;
  Estimate e = evenlyLit(featuresOf(glass, 4));
  const Estimate before = e;
  settleAlbedo(e, kNoisy, &f, kPasses);
  CHECK(e.mean[0].at(5, 5) == before.mean[0].at(5, 5));
  for (int i = 0; i < 5; ++i) CHECK(e.mean[0].at(8 + 8 * i, 20) == before.mean[0].at(8 + 8 * i, 20));
  for (const float v : e.mean[0].data) CHECK((v > 0 && v <= 2 * kIrradiance));
}

TEST_CASE("Noise of the albedo is told as an error, as large as it is, where an image is filtered") {
  const auto glass = [](int, int, float u) { return u < 0.25f ? 0.4f : 0.7f; };
  const Features f = featuresOf(glass, 6);
  const Estimate e = evenlyLit(f);
  const Plane<float> noise = albedoNoise(e.mean, &f);
  double told = 0;
  for (const float v : noise.data) told += static_cast<double>(v);
  CHECK(told == doctest::Approx(squaredError(e.mean, kIrradiance * 0.625f)).epsilon(0.1));  // four standard errors

  Features halved = f;  // halves tell the noise themselves, whatever variance is reported
  for (size_t h = 0; h < 2; ++h) halved.albedo.half[h] = shiftedAlbedo(f, h == 0 ? 1.0f : -1.0f);
  for (Plane<float>& plane : halved.albedo.variance.channel) std::fill(plane.data.begin(), plane.data.end(), 1e6f);
  const Plane<float> ofHalves = albedoNoise(e.mean, &halved);
  for (size_t i = 0; i < noise.size(); ++i) CHECK(ofHalves[i] == doctest::Approx(noise[i]).epsilon(1e-3));

  const auto mean = [&](float variance) {
    const Plane<float> map = mixtureErrorMap(e.half, Rgb<float>(kWidth, kHeight, variance), e.mean, noise);
    double sum = 0;
    for (const float v : map.data) sum += static_cast<double>(v);
    return sum;
  };
  CHECK(mean(1) == doctest::Approx(told));  // halves without a spread: all is filtered
  CHECK(mean(0) == 0);                      // x itself

  Features strange = f;
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kMost = std::numeric_limits<float>::max();
  for (size_t c = 0; c < 3; ++c) {
    strange.albedo.mean[c].at(1, 1) = kNan;
    strange.albedo.variance[c].at(2, 1) = kNan;
    strange.albedo.variance[c].at(3, 1) = kMost;
    strange.albedo.mean[c].at(4, 1) = 0;
  }
  strange.depth.mean.at(5, 1) = 0;
  const Plane<float> sane = albedoNoise(e.mean, &strange);
  for (const float v : sane.data) CHECK((std::isfinite(v) && v >= 0));
  CHECK(sane.at(5, 1) == 0);
  CHECK(albedoNoise(e.mean, nullptr).empty());
}

TEST_CASE(
    "auto tells noise of the albedo and settles it at few samples, and leaves it with --auto-settle-albedo 0 and from "
    "64 on") {
  for (const uint64_t samples : {4, 64}) {
    CaseOptions o;
    o.width = kWidth;
    o.height = kHeight;
    o.samples = samples;
    Case c = makeCase(o);
    std::erase_if(c.estimates.estimates, [](const Estimate& x) { return x.name != "pt"; });
    c.estimates.features->albedo = featuresOf([](int, int, float u) { return u < 0.25f ? 0.3f : 0.7f; }, 5).albedo;
    for (size_t h = 0; h < 2; ++h)
      c.estimates.features->albedo.half[h] = shiftedAlbedo(*c.estimates.features, h == 0 ? 1.0f : -1.0f);
    const auto image = [&](double settles) {
      PipelineOptions options;
      options.numbers.set("auto-settle-albedo", settles);
      return runPipeline(c.estimates, {"auto"}, options).find("auto")->result.image.mean[0].data;
    };
    CAPTURE(samples);
    CHECK((image(1) == image(0)) == (samples == 64));
    const auto told = [&] {
      const Plane<float> error = runPipeline(c.estimates, {"auto"}, {}).find("auto")->result.error;
      return std::accumulate(error.data.begin(), error.data.end(), 0.0);
    };
    const double withNoise = told();
    c.estimates.features->albedo.half[0] = c.estimates.features->albedo.half[1];
    if (samples == 64) CHECK(withNoise > 1.5 * told());
  }
}

}  // namespace braid::test_settled_albedo
