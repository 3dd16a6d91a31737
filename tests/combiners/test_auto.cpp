// SPDX-License-Identifier: Apache-2.0
// The combiner "auto" and its parts: fused estimates, the removal of fireflies, relative error maps.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include <doctest/doctest.h>

#include "combiners/statistics/fireflies.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/shrinkage/fused_estimate.h"
#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/pipeline.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_auto {

using namespace test;

namespace {

// The estimates of the names and the features.
Estimates kept(const Case& c, const std::vector<std::string>& names) {
  Estimates e = c.estimates;
  std::erase_if(e.estimates, [&](const Estimate& x) { return !std::count(names.begin(), names.end(), x.name); });
  return e;
}

PipelineOutput outputOf(const Estimates& e, const std::string& method, const PipelineOptions& options = {}) {
  const PipelineResult result = runPipeline(e, {method}, options);
  const PipelineOutput* out = result.find(method);
  REQUIRE(out);
  INFO(out->step.skipReason);
  REQUIRE(out->ran());
  return *out;
}

Case noisyCase(uint64_t samples, double fireflies = 0, uint64_t seed = 1) {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.samples = samples;
  o.fireflies = fireflies;
  o.seed = seed;
  return makeCase(o);
}

double relativeError(const Rgb<float>& image, const Rgb<float>& truth) {
  double sum = 0;
  for (size_t i = 0; i < image.size(); ++i) {
    double level = 0, square = 0;
    for (size_t c = 0; c < 3; ++c) {
      level += static_cast<double>(truth[c][i]) / 3;
      square += sqr(static_cast<double>(image[c][i]) - static_cast<double>(truth[c][i])) / 3;
    }
    sum += square / (level * level + 0.01);
  }
  return sum / static_cast<double>(image.size());
}

double relativeSum(const Plane<float>& error, const Rgb<float>& truth) {
  double sum = 0;
  for (size_t i = 0; i < error.size(); ++i) {
    double level = 0;
    for (size_t c = 0; c < 3; ++c) level += static_cast<double>(truth[c][i]) / 3;
    sum += static_cast<double>(error[i]) / (level * level + 0.01);
  }
  return sum / static_cast<double>(error.size());
}

// A grey image whose quarters and halves agree, with the given variance.
Estimate flat(float value, float variance, int width = 40, int height = 30) {
  Estimate e;
  e.passes = 64;
  e.mean = e.half[0] = e.half[1] = Rgb<float>(width, height, value);
  e.quarter.assign(4, e.mean);
  e.variance = Rgb<float>(width, height, variance);
  return e;
}

void setPixel(Estimate& e, size_t i, float value, const std::array<float, 4>& quarters, float variance) {
  for (size_t c = 0; c < 3; ++c) {
    e.mean[c][i] = value;
    for (size_t q = 0; q < 4; ++q) e.quarter[q][c][i] = quarters[q];
    e.half[0][c][i] = 0.5f * (quarters[0] + quarters[2]);
    e.half[1][c][i] = 0.5f * (quarters[1] + quarters[3]);
    e.variance[c][i] = variance;
  }
}

}  // namespace

TEST_CASE("auto is far better than the unbiased image and hardly ever worse than its filters") {
  int worse = 0, cells = 0;
  for (const uint64_t samples : {8, 32, 128})
    for (const double fireflies : {0.0, 0.001}) {
      const Case c = noisyCase(samples, fireflies);
      const Estimates e = kept(c, {"pt"});
      const double best = relativeError(outputOf(e, "auto").result.image.mean, c.truth);
      double input = relativeError(c.pt().mean, c.truth);
      CAPTURE(samples);
      CAPTURE(fireflies);
      CHECK(best < 0.25 * input);
      for (const char* filter : {"pw-wide", "pw1"})
        input = std::min(input, relativeError(outputOf(e, filter).result.image.mean, c.truth));
      ++cells;
      worse += best > 1.05 * input;
      CHECK(best < 1.25 * input);
    }
  CHECK(cells == 6);
  CHECK(worse <= 2);  // both with fireflies in one of ten pixels
}

TEST_CASE("auto's error map agrees with the true error of the image within a factor of two") {
  double logarithms = 0;
  int cases = 0;
  for (const uint64_t samples : {16, 64, 256}) {
    const Case c = noisyCase(samples, 0, samples);
    for (const std::vector<std::string>& names : {std::vector<std::string>{"pt"}, {"pt", "sppm"}}) {
      const PipelineOutput out = outputOf(kept(c, names), "auto");
      const double ratio = relativeSum(out.result.error, c.truth) / relativeError(out.result.image.mean, c.truth);
      CAPTURE(samples);
      CAPTURE(names.size());
      CHECK(ratio > 0.4);
      CHECK(ratio < 2.5);
      logarithms += std::log(ratio);
      ++cases;
    }
  }
  CHECK(std::fabs(logarithms / cases) < std::log(2.0));
}

TEST_CASE("With a photon map auto is better than with either image alone") {
  CaseOptions o;
  o.noise = 8;
  o.photonBlur = 1;
  const Case c = makeCase(o);
  const double both = relativeError(outputOf(kept(c, {"pt", "sppm"}), "auto").result.image.mean, c.truth);
  CHECK(both < 0.9 * relativeError(outputOf(kept(c, {"pt"}), "auto").result.image.mean, c.truth));
  CHECK(both < 0.9 * relativeError(c.sppm().mean, c.truth));
  CHECK(both < 0.1 * relativeError(c.pt().mean, c.truth));
}

TEST_CASE("A denoiser whose image is worse than its halves show is not believed") {
  const Case c = noisyCase(64);
  Estimates e = kept(c, {"pt"});
  Estimate liar;  // halves next to the truth, an image that is black
  liar.name = "liar";
  liar.unbiased = false;
  liar.half[0] = liar.half[1] = c.truth;
  liar.mean = Rgb<float>(e.width, e.height);
  const double without = relativeError(outputOf(e, "auto").result.image.mean, c.truth);
  e.estimates.push_back(liar);
  CHECK(relativeError(outputOf(e, "auto").result.image.mean, c.truth) < 1.1 * without);
}

TEST_CASE("auto with two passes is the filter's image, with one it says what it needs") {
  const Estimates two = kept(noisyCase(2), {"pt"});
  PipelineOptions options;
  CHECK(identical(outputOf(two, "auto").result.image.mean, outputOf(two, "pw").result.image.mean));
  const PipelineResult one = runPipeline(kept(noisyCase(1), {"pt"}), {"auto"}, options);
  CHECK(one.find("auto")->step.skipReason.find("needs 2 passes") != std::string::npos);
}

TEST_CASE("Without photon maps the fused estimate is the unbiased one") {
  const Case c = noisyCase(16);
  const FusedEstimate f = fusedEstimate(c.pt(), {}, nullptr);
  CHECK(identical(f.image.mean, c.pt().mean));
  CHECK(identical(f.image.variance, c.pt().variance));
  CHECK(f.squaredBias.empty());
}

TEST_CASE("Fused weights are inverse errors, with squared biases counted twice, and the bias that is left is told") {
  Estimate x = flat(1.0f, 0.03f), s = flat(1.0f, 0.005f);
  s.name = "sppm";
  s.unbiased = false;
  const float bias = std::sqrt(0.005f);
  s.mean = s.half[0] = s.half[1] = Rgb<float>(40, 30, 1 - bias);
  s.quarter.assign(4, s.mean);
  s.bias = Rgb<float>(40, 30, bias);
  s.biasVariance = Rgb<float>(40, 30);
  const FusedEstimate f = fusedEstimate(x, {&s}, nullptr);
  // Errors 0.03 and 0.005 + 2 · 0.005: weights 1/3 and 2/3.
  CHECK(f.image.mean[0][500] == doctest::Approx(1 - bias * 2 / 3).epsilon(1e-3));
  CHECK(f.image.quarter[2][1][500] == doctest::Approx(1 - bias * 2 / 3).epsilon(1e-3));
  CHECK(f.image.variance[0][500] == doctest::Approx((0.03 + 4 * 0.015) / 9).epsilon(1e-3));
  CHECK(f.squaredBias[500] == doctest::Approx(4 * 2 * 0.005 / 9).epsilon(1e-3));
}

TEST_CASE("A firefly that both images hold makes no noise of the pixels around it") {
  // Its smoothed variances decide the weights of the whole window; the noise of a pixel stays its own.
  Estimate x = flat(1.0f, 1e-3f), s = flat(1.0f, 3e-3f);
  s.bias = s.biasVariance = Rgb<float>(40, 30);
  const size_t firefly = x.mean[0].index(20, 15);
  for (Estimate* e : {&x, &s}) setPixel(*e, firefly, 226, {1, 901, 1, 1}, 5e4f);
  const FusedEstimate f = fusedEstimate(x, {&s}, nullptr);
  CHECK(f.noise[0][firefly] > 1e4f);
  for (const size_t beside : {firefly + 1, firefly - 3, firefly + 3 * 40}) {
    // Weights of about 1/2 each, for the firefly's errors are alike.
    CHECK(f.noise[1][beside] == doctest::Approx(0.25 * 1e-3 + 0.25 * 3e-3).epsilon(0.01));
    CHECK(f.image.variance[1][beside] == f.noise[1][beside]);
  }
}

TEST_CASE("A photon map without bias leaves none in the error, however noisy its estimate of it is") {
  const int width = 120, height = 90;
  Estimate x = flat(1.0f, 1e-3f, width, height), s = flat(1.0f, 1e-3f, width, height);
  std::mt19937 random(1);
  std::normal_distribution<float> normal(0, 0.05f);
  s.bias = Rgb<float>(width, height);
  s.biasVariance = Rgb<float>(width, height, sqr(0.05f));
  for (Plane<float>& plane : s.bias.channel)
    for (float& b : plane.data) b = normal(random);
  const FusedEstimate f = fusedEstimate(x, {&s}, nullptr);
  const double pixels = width * height;
  double mean = 0, square = 0, claimed = 0;
  for (size_t i = 0; i < f.squaredBias.size(); ++i) {
    const auto sample = static_cast<double>(f.squaredBias[i]);
    mean += sample / pixels;
    square += sample * sample / pixels;
    claimed += static_cast<double>(f.image.variance[0][i] - f.noise[0][i]) / pixels;
  }
  CHECK(std::fabs(mean) < 4 * std::sqrt(square / pixels));  // one false alarm in 16,000 seeds
  CHECK(claimed > 0);                                       // weights and filters count on the worst
  CHECK(relativeSum(smoothedSquaredBias(f.squaredBias, x.mean), x.mean) < 0.1 * sqr(0.05));
  // A bias, on the other hand, is found.
  for (Plane<float>& plane : s.bias.channel)
    for (float& b : plane.data) b += 0.2f;
  const FusedEstimate biased = fusedEstimate(x, {&s}, nullptr);
  const double share = 1 - (0.001 + 0.04) / (0.001 + 0.001 + 0.04);  // of the photon map, by inverse errors
  CHECK(relativeSum(smoothedSquaredBias(biased.squaredBias, x.mean), x.mean) ==
        doctest::Approx(sqr(share) * 0.04 / 1.01).epsilon(0.1));
}

TEST_CASE(
    "Squared errors that halves show are those of half the samples: less of them is the image's where it follows") {
  // Halves of x deviate by +-s, so that v = s² / 2; both halves of the image are off by b.
  const double s = 0.1, b = 0.05, v = s * s / 2;
  Estimate x = flat(1.0f, static_cast<float>(v));
  x.half[0] = Rgb<float>(40, 30, static_cast<float>(1 + s));
  x.half[1] = Rgb<float>(40, 30, static_cast<float>(1 - s));
  const Rgb<float> halves[2] = {Rgb<float>(40, 30, static_cast<float>(1 + b)),
                                Rgb<float>(40, 30, static_cast<float>(1 + b))};
  const double unit = 1.01, measured = unit * b * b / (unit + v);
  CHECK(crossHalfErrorMap(halves, x, x.variance, x.mean)[500] == doctest::Approx(measured).epsilon(1e-3));
  CHECK(crossHalfErrorMap(halves, x, x.variance, x.mean, {true, 1})[500] ==
        doctest::Approx(measured * 2 * v / (2 * v + b * b)).epsilon(1e-3));
  CHECK(crossHalfErrorMap(halves, x, x.variance, x.mean, {true, 0.5})[500] ==
        doctest::Approx(0.5 * measured * 2 * v / (2 * v + b * b)).epsilon(1e-3));
  const Estimate exact = flat(1.0f, 0.0f);
  CHECK(crossHalfErrorMap(exact.half, exact, exact.variance, exact.mean, {true, 1})[500] == 0);
}

TEST_CASE("Where the unbiased image has not found the light, the photon map is believed") {
  // No sample has hit the caustic in the left half: half the light, and a variance that knows nothing of the rest.
  Estimate x = flat(1.0f, 1e-6f), s = flat(1.0f, 1e-3f);
  s.unbiased = false;
  s.bias = s.biasVariance = Rgb<float>(40, 30);
  for (int y = 0; y < 30; ++y)
    for (int u = 0; u < 20; ++u)
      for (size_t c = 0; c < 3; ++c) x.mean[c].at(u, y) = 0.5f;
  const FusedEstimate f = fusedEstimate(x, {&s}, nullptr);
  CHECK(f.image.mean[0].at(5, 15) > 0.99f);
  // Too bright, on the other hand, is no sign of missing light: the small variance is believed.
  for (size_t c = 0; c < 3; ++c)
    for (float& v : x.mean[c].data) v = 1.5f;
  CHECK(fusedEstimate(x, {&s}, nullptr).image.mean[0].at(5, 15) > 1.49f);
}

TEST_CASE("A firefly of the photon map does not take the caustic around it") {
  Estimate x = flat(0.1f, 1e-6f), s = flat(0.5f, 1e-3f);
  s.unbiased = false;
  s.bias = s.biasVariance = Rgb<float>(40, 30);
  const size_t firefly = s.mean[0].index(20, 15);
  setPixel(s, firefly, 200, {797, 1, 1, 1}, 4e4f);
  const FusedEstimate f = fusedEstimate(x, {&s}, nullptr);
  for (const size_t beside : {firefly + 1, firefly - 2 * 40, firefly + 6 * 40 - 6})
    CHECK(f.image.mean[1][beside] == doctest::Approx(0.5).epsilon(0.05));
  CHECK(f.image.mean[1][firefly] < 1);  // its own pixel it does take
}

TEST_CASE("A firefly in one quarter is replaced, a lamp in all of them stays") {
  Estimate x = flat(1.0f, 1e-4f);
  const size_t firefly = x.mean[0].index(10, 10), lamp = x.mean[0].index(30, 20);
  setPixel(x, firefly, 50, {197, 1, 1, 1}, 2400);
  setPixel(x, lamp, 50, {49, 51, 50, 50}, 2400);
  const std::vector<Firefly> fireflies = findFireflies(x, {&x.quarter}, nullptr);
  REQUIRE(fireflies.size() == 1);
  CHECK(fireflies[0].index == firefly);
  Rgb<float> image = x.mean, variance = x.variance;
  replaceValues(image, fireflies);
  replaceVariances(variance, fireflies);
  CHECK(variance[2][firefly] == doctest::Approx(1e-4));
  CHECK(image[1][firefly] == doctest::Approx(1.0));
  CHECK(image[1][lamp] == 50.0f);
  // Quarters in other units, and one with a bad value, tell the same.
  std::vector<Rgb<float>> given = x.quarter;
  for (Rgb<float>& quarter : given)
    for (Plane<float>& plane : quarter.channel)
      for (size_t i = 0; i < plane.size(); ++i) plane[i] /= 1024;
  given[2][0][firefly] = std::numeric_limits<float>::quiet_NaN();
  const std::vector<Firefly> scaled = findFireflies(x, {&given, 1024}, nullptr);
  REQUIRE(scaled.size() == 1);
  CHECK(scaled[0].index == firefly);
  CHECK(findFireflies(x, {&given, 1}, nullptr).size() == 2);  // the lamp's quarters seem dark
}

TEST_CASE("Without quarters the halves tell fireflies, and without halves nothing does") {
  Estimate x = flat(1.0f, 1e-4f);
  const size_t firefly = x.mean[0].index(10, 10), lamp = x.mean[0].index(30, 20);
  setPixel(x, firefly, 50, {197, 1, 1, 1}, 2400);
  setPixel(x, lamp, 50, {49, 51, 50, 50}, 2400);
  x.quarter.clear();
  const std::vector<Firefly> fireflies = findFireflies(x, {&x.quarter}, nullptr);
  REQUIRE(fireflies.size() == 1);
  CHECK(fireflies[0].index == firefly);
  const Estimate clean = withoutFireflies(x, {}, nullptr);
  for (const Rgb<float>* image : {&clean.mean, &clean.half[0], &clean.half[1]}) {
    CHECK((*image)[1][firefly] == doctest::Approx(1.0));
    CHECK((*image)[1][lamp] > 40.0f);
  }
  CHECK(clean.variance[1][firefly] == doctest::Approx(1e-4));
  x.half[0] = x.half[1] = {};
  CHECK(findFireflies(x, {}, nullptr).empty());
}

TEST_CASE("A firefly in one quarter leaves nothing in its neighbours either") {
  // Noise of 0.03 around 1, and one pixel of 200 in one quarter.
  Estimate x = flat(1.0f, 0);
  std::mt19937 random(5);
  std::normal_distribution<float> normal(1.0f, 0.06f);
  for (size_t i = 0; i < x.mean.size(); ++i) {
    std::array<float, 4> quarters{};
    for (float& q : quarters) q = normal(random);
    setPixel(x, i, (quarters[0] + quarters[1] + quarters[2] + quarters[3]) / 4, quarters, 9e-4f);
  }
  setPixel(x, x.mean[0].index(20, 15), 200, {797, 1, 1, 1}, 4e4f);
  x.name = "pt";
  Estimates e;
  e.width = 40;
  e.height = 30;
  e.estimates.push_back(x);
  const auto largest = [&](const PipelineOptions& options) {
    const Rgb<float> image = outputOf(e, "auto", options).result.image.mean;
    return *std::max_element(image[0].data.begin(), image[0].data.end());
  };
  CHECK(largest({}) < 1.1f);
  PipelineOptions kept;
  kept.numbers.set("auto-remove-fireflies", 0);
  CHECK(largest(kept) > 2);
}

TEST_CASE("Fireflies are replaced in place where that is allowed, and nowhere else, with the same bits") {
  Case c = noisyCase(64);
  Estimate& x = *std::find_if(c.estimates.estimates.begin(), c.estimates.estimates.end(),
                              [](const Estimate& e) { return e.name == "pt"; });
  const size_t at = x.mean[0].index(40, 30);
  for (size_t channel = 0; channel < 3; ++channel) {
    x.mean[channel][at] += 50;
    x.half[0][channel][at] += 100;
    x.quarter[0][channel][at] += 200;
    x.variance[channel][at] += 2500;
  }
  const auto method = findMethod("auto");
  MethodInputs in;
  in.unbiased = &x;
  in.features = &*c.estimates.features;
  in.quarters = {&x.quarter};
  const Estimate before = x;
  const MethodResult copied = method->run(in);
  CHECK(identical(x.mean, before.mean));
  CHECK(identical(x.variance, before.variance));
  in.consumable = &x;
  const MethodResult inPlace = method->run(in);
  CHECK(x.mean[0][at] < 25);
  CHECK(identical(copied.image.mean, inPlace.image.mean));
  CHECK(identical(copied.error, inPlace.error));
}

TEST_CASE("The rim of a lamp, darker than the lamp and noisier than all around it, stays as it is") {
  // The lamp's pixels are brighter, without noise and of another surface than the rim and the wall.
  Estimate x = flat(0.5f, 1e-8f);
  Features features;
  for (FeaturePlanes<Rgb<float>>* f : {&features.albedo, &features.normal}) {
    f->mean = Rgb<float>(40, 30, 0.0f);
    f->half[0] = f->half[1] = f->mean;
  }
  for (int y = 10; y < 20; ++y)
    for (int u = 10; u < 20; ++u) {
      const size_t i = x.mean[0].index(u, y);
      const bool rim = u == 10 || u == 19 || y == 10 || y == 19;
      const float value = rim ? 0.9f : 1.4f;
      setPixel(x, i, value, {value - 0.005f, value + 0.005f, value, value}, rim && (u + y) % 7 == 0 ? 2e-5f : 1e-8f);
      for (size_t c = 0; c < 3; ++c) features.albedo.mean[c][i] = rim ? 0.5f : 1.0f;
    }
  CHECK(findFireflies(x, {&x.quarter}, &features).empty());
}

TEST_CASE("A noisy lamp lends the dark pixels around it no error that they cannot have") {
  Estimate x = flat(0.01f, 1e-8f);
  const size_t lamp = x.mean[0].index(20, 15);
  setPixel(x, lamp, 100, {90, 110, 95, 105}, 16);
  const Plane<float> error = crossHalfErrorMap(x.half, x, x.variance, x.mean);
  const double beside = static_cast<double>(error[lamp + 3]);
  CHECK(static_cast<double>(error[lamp]) > 0.1);
  CHECK(beside / 0.01 < 0.02);  // relative; the lamp's own relative error is 0.0056
}

TEST_CASE("auto takes a consistent estimate in the place of an unbiased one, as it would that, and never twice") {
  Estimates unbiased = kept(noisyCase(16), {"pt"}), consistent = unbiased;
  consistent.estimates[0].unbiased = false;
  const PipelineOutput one = outputOf(unbiased, "auto"), other = outputOf(consistent, "auto");
  CHECK(other.step.unbiased == "pt");
  CHECK(other.step.bases.empty());
  bool same = true;
  for (size_t i = 0; i < one.result.error.size(); ++i)
    same &= one.result.image.mean.pixel(i) == other.result.image.mean.pixel(i) &&
            one.result.error[i] == other.result.error[i];
  CHECK(same);
}

}  // namespace braid::test_auto
