// SPDX-License-Identifier: Apache-2.0
// What the patch-Welch filter promises: invariances, edges, scales of light, less error with more samples.
#include <array>
#include <cmath>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/denoise/pw/pw_filter.h"
#include "tests/support/combiner_fixture.h"

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace braid::test_pw {

using namespace test;

namespace {

constexpr std::array kThresholds = {kPatchWelchThreshold, kPatchWelchWideThreshold};

const Features& featuresOf(const Case& c) { return *c.estimates.features; }

std::vector<Rgb<float>> filtered(const Estimate& e, const Features* features, double z = kPatchWelchThreshold) {
  return patchWelch(patchWelchInput(e, features), std::array{z})[0];
}

// An image of known means and variances without features or halves; 16 passes.
Estimate plainEstimate(const Rgb<float>& mean, float variance) {
  Estimate e;
  e.passes = 16;
  e.mean = mean;
  e.variance = Rgb<float>(mean.width(), mean.height(), variance);
  return e;
}

Rgb<float> halfPlanes(int width, int height, float left, float right) {
  Rgb<float> image(width, height, left);
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = width / 2; x < width; ++x) image[c].at(x, y) = right;
  return image;
}

double largestDifference(const Rgb<float>& a, const Rgb<float>& b) {
  double worst = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < a.size(); ++i) worst = std::max(worst, static_cast<double>(std::fabs(a[c][i] - b[c][i])));
  return worst;
}

}  // namespace

TEST_CASE("Several thresholds in one pass give the bits of one pass each") {
  const Case c = caseOf(60, 41, 8);
  const auto both = patchWelch(patchWelchInput(c.pt(), &featuresOf(c)), kThresholds);
  for (size_t k = 0; k < 2; ++k) {
    const auto alone = filtered(c.pt(), &featuresOf(c), kThresholds[k]);
    for (size_t i = 0; i < 3; ++i) CHECK(identical(alone[i], both[k][i]));
  }
}

TEST_CASE("Neither tiles nor threads change a bit of the patch-Welch filter") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Case c = caseOf(257, 89, 8);
  const PatchWelchInput input = patchWelchInput(c.pt(), &featuresOf(c));
  const auto usual = patchWelch(input, kThresholds);
  for (const TileSize tiles : {TileSize{17, 5}, {64, 64}, {400, 200}, {257, 1}}) {
    const auto other = patchWelch(input, kThresholds, {}, tiles);
    for (size_t i = 0; i < 3; ++i) CHECK(identical(usual[1][i], other[1][i]));
  }
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    const auto other = arena.execute([&] { return patchWelch(input, kThresholds); });
    for (size_t i = 0; i < 3; ++i) CHECK(identical(usual[0][i], other[0][i]));
  }
}

TEST_CASE("A constant image is invariant, whatever its variance") {
  for (const float variance : {0.0f, 1e-8f, 1.0f, 1e8f}) {
    const Rgb<float> image(50, 37, 0.7f);
    CHECK(largestDifference(filtered(plainEstimate(image, variance), nullptr)[0], image) < 1e-6);
  }
}

TEST_CASE("Without variance the output is the input") {
  const Case c = caseOf(64, 48, 8);
  CHECK(largestDifference(filtered(plainEstimate(c.truth, 0), &featuresOf(c))[0], c.truth) < 1e-6);
}

TEST_CASE("Means eight standard deviations apart are not mixed, means one apart are") {
  for (const double z : kThresholds)
    for (const uint64_t passes : {4, 64}) {
      const float sd = 0.1f;
      const auto at = [&](float deviations) {
        const Rgb<float> image = halfPlanes(40, 20, 1, 1 + deviations * sd);
        Estimate e = plainEstimate(image, sd * sd);
        e.passes = passes;
        return largestDifference(filtered(e, nullptr, z)[0], image);
      };
      CHECK(at(8) < 1e-5);  // rounding of 440 additions
      CHECK(at(1) > 0.2 * static_cast<double>(sd));
    }
}

TEST_CASE("Light scales the output of the patch-Welch filter and nothing else") {
  const Case one = caseOf(64, 48, 8);
  const auto expected = filtered(one.pt(), &featuresOf(one));
  for (const double light : {0x1p-20, 0x1p20, 1e-6, 1e6}) {
    const Case scaled = caseOf(64, 48, 8, 1, light);
    Rgb<float> image = filtered(scaled.pt(), &featuresOf(scaled))[0];
    for (size_t c = 0; c < 3; ++c)
      for (float& v : image[c].data) v = static_cast<float>(static_cast<double>(v) / light);
    CAPTURE(light);
    // The samples are rounded anew; 1e-4 of a pixel is far above what that does through the weights.
    CHECK(largestDifference(image, expected[0]) < 1e-4);
  }
}

TEST_CASE("Four times the samples shrink the error of the patch-Welch filter, which is always below the noise" *
          doctest::test_suite("statistics")) {
  for (const double z : kThresholds) {
    double last = kInfinity;
    for (const uint64_t samples : {8, 32, 128, 512}) {
      const Case c = caseOf(96, 72, samples);
      const double error = meanSquaredError(filtered(c.pt(), &featuresOf(c), z)[0], c.truth);
      CAPTURE(samples);
      CHECK(error < 0.6 * last);
      CHECK(error < 0.25 * meanSquaredError(c.pt().mean, c.truth));
      last = error;
    }
  }
}

TEST_CASE("Black albedo, tiny and huge values and flushed subnormals leave finite images") {
#if defined(__SSE2__)
  const unsigned int mode = _mm_getcsr();
  _mm_setcsr(mode | 0x8040);  // flush to zero, denormals are zero
#endif
  tbb::task_arena here(1);
  here.execute([] {
    for (const double light : {1e-18, 1e-12, 1e12}) {
      Case c = caseOf(40, 30, 8, 1, light);
      for (size_t k = 0; k < 3; ++k) std::fill_n(c.estimates.features->albedo.mean[k].data.begin(), 600, 0.0f);
      const auto images = filtered(c.pt(), &featuresOf(c));
      for (const Rgb<float>& image : images) CHECK(allFinite(image));
    }
    Case c = caseOf(40, 30, 8);
    for (const float bad : {kInfinity, -kInfinity, std::nanf(""), 1e30f}) {
      Estimate e = c.pt();
      e.mean[0][77] = e.half[0][1][500] = e.variance[2][333] = e.variance[1][77] = bad;
      for (const Rgb<float>& image : filtered(e, &featuresOf(c))) CHECK(allFinite(image));
    }
  });
#if defined(__SSE2__)
  _mm_setcsr(mode);
#endif
}

TEST_CASE("Pixels where every ray has missed the scene and those at its edge are not mixed") {
  // A black background below an edge that covers a tenth of its pixels, as noisy as light that is rarely met.
  constexpr int kEdge = 12;
  Case c = caseOf(40, 24, 8);
  Features& f = *c.estimates.features;
  Estimate e = plainEstimate(Rgb<float>(40, 24, 0.0f), 0);
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 40; ++x) {
      const size_t i = e.mean[0].index(x, y);
      const bool miss = y > kEdge;
      f.depth.mean.data[i] = miss ? 0.0f : 0.3f;
      f.albedo.mean.set(i, Vec3(miss ? 0.0f : 0.07f));
      f.normal.mean.set(i, Vec3(0, 0, -1));
      if (miss) continue;
      e.mean.set(i, Vec3(x % 4 == 0 ? 0.04f : 0.0f));
      for (size_t k = 0; k < 3; ++k) e.variance[k].data[i] = 0.0003f;
    }
  const Rgb<float> image = filtered(e, &f, kPatchWelchWideThreshold)[0];
  double background = 0, edge = 0;
  for (int x = 10; x < 30; ++x) {
    background = std::max(background, static_cast<double>(image[0].at(x, kEdge + 1)));
    edge += static_cast<double>(image[0].at(x, kEdge)) / 20;
  }
  CHECK(background < 1e-30);
  CHECK(edge == doctest::Approx(0.01).epsilon(0.1));
}

TEST_CASE("The halves average to the full output within the noise") {
  const Case c = caseOf(96, 72, 64);
  const auto images = filtered(c.pt(), &featuresOf(c));
  Rgb<float> average = images[1];
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < average.size(); ++i) average[k][i] = 0.5f * (images[1][k][i] + images[2][k][i]);
  // The average may differ from the full output by what the filter itself errs, not by what the input does.
  const double difference = meanSquaredError(average, images[0]);
  CHECK(difference > 0);
  CHECK(difference < meanSquaredError(images[0], c.truth));
  CHECK(difference < 0.1 * meanSquaredError(c.pt().mean, c.truth));
}

TEST_CASE("The other half estimates the error of a half within a factor of two" * doctest::test_suite("statistics")) {
  for (const uint64_t samples : {16, 64}) {
    double estimated = 0, actual = 0;
    for (uint64_t seed = 1; seed <= 8; ++seed) {
      const Case c = caseOf(96, 72, samples, seed);
      const auto images = filtered(c.pt(), &featuresOf(c));
      for (size_t h = 0; h < 2; ++h) {
        estimated += meanSquaredError(images[1 + h], c.pt().half[1 - h]);
        actual += meanSquaredError(images[1 + h], c.truth);
        for (size_t k = 0; k < 3; ++k)  // less the variance of the other half
          for (const float v : c.pt().variance[k].data)
            estimated -= 2 * static_cast<double>(v) / static_cast<double>(3 * c.truth.size());
      }
    }
    CAPTURE(samples);
    CAPTURE(estimated / actual);
    CHECK(estimated > 0.5 * actual);
    CHECK(estimated < 2 * actual);
  }
}

TEST_CASE("Planes that an image of another renderer lacks are done without") {
  const Case c = caseOf(96, 72, 32);
  const double noise = meanSquaredError(c.pt().mean, c.truth);
  const auto error = [&](const Estimate& e, const Features* f) { return meanSquaredError(filtered(e, f)[0], c.truth); };
  Features albedoOnly = featuresOf(c);
  albedoOnly.normal.mean = Rgb<float>();
  albedoOnly.depth.mean = albedoOnly.visibility.mean = Plane<float>();
  CHECK(error(c.pt(), &albedoOnly) < 0.25 * noise);
  CHECK(error(c.pt(), nullptr) < 0.5 * noise);
  Estimate noVariance = c.pt();
  noVariance.variance = Rgb<float>();
  CHECK(error(noVariance, &featuresOf(c)) < 0.25 * noise);
  Estimate noHalves = c.pt();
  noHalves.half[0] = noHalves.half[1] = Rgb<float>();
  CHECK(filtered(noHalves, &featuresOf(c)).size() == 1);
  CHECK(error(noHalves, &featuresOf(c)) < 0.25 * noise);
}

}  // namespace braid::test_pw
