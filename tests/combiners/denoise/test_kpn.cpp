// SPDX-License-Identifier: Apache-2.0
// What kernel prediction promises whatever its network says: weights that sum to 1, linearity, nothing blurred that
// differs for sure, any size of image.
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include "combiners/denoise/kpn/kpn_filter.h"
#include "combiners/denoise/kpn/kpn_planes.h"
#include "combiners/learned/convolution.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/parallel.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_kpn {

using namespace test;

namespace {

struct Size {
  int width, height;
};
constexpr Size kSizes[] = {{1, 1}, {2, 1}, {1, 7}, {5, 3}, {64, 32}, {67, 41}};

template <class Make>
Plane<float> planeOf(const Size& size, const Make& make) {
  Plane<float> plane(size.width, size.height);
  for (float& v : plane.data) v = make();
  return plane;
}

// What some network might say of an image.
KpnFeatures randomFeatures(const Size& size, uint32_t seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<float> normal;
  KpnFeatures features = kpnFeatures(size.width, size.height);
  for (auto& level : features.level)
    for (Plane<float>& plane : level)
      for (float& v : plane.data) v = normal(engine);
  shrinkToLevels(features);
  return features;
}

Rgb<float> randomImage(const Size& size, uint32_t seed) {
  std::mt19937 engine(seed);
  std::exponential_distribution<float> light;
  Rgb<float> image;
  for (size_t c = 0; c < 3; ++c) image[c] = planeOf(size, [&] { return light(engine); });
  return image;
}

KpnTests someTests() {
  KpnTests tests;
  tests.steepness.fill(0.5f);
  tests.gateSteepness.fill(0.5f);
  tests.tolerance.fill(2);
  tests.gateTolerance.fill(2);
  return tests;
}

double largestDifference(const Rgb<float>& a, const Rgb<float>& b) {
  double worst = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::abs(static_cast<double>(a[c][i] - b[c][i])));
  return worst;
}

}  // namespace

TEST_CASE("kpn: a constant image stays what it is, whatever the features") {
  for (const Size& size : kSizes) {
    const Rgb<float> image(size.width, size.height, 0.7f);
    const Plane<float> variance(size.width, size.height, 0.01f);
    const Rgb<float> out = kpnFiltered(image, variance, randomFeatures(size, 1), someTests());
    CHECK(largestDifference(out, image) < 1e-5);
  }
}

TEST_CASE("kpn: noise is averaged, and the brightness of a noisy image kept by even weights") {
  const Size size{64, 32};
  std::mt19937 engine(5);
  std::normal_distribution<float> noise(1, 0.3f);
  Rgb<float> image;
  for (size_t c = 0; c < 3; ++c) image[c] = planeOf(size, [&] { return noise(engine); });
  const Plane<float> variance(size.width, size.height,
                              0.09f * (0.2126f * 0.2126f + 0.7152f * 0.7152f + 0.0722f * 0.0722f));
  KpnFeatures features = kpnFeatures(size.width, size.height);
  for (auto& level : features.level)
    for (Plane<float>& plane : level) std::fill(plane.data.begin(), plane.data.end(), 0.0f);
  shrinkToLevels(features);
  const Rgb<float> out = kpnFiltered(image, variance, features, someTests());
  double before = 0, after = 0, mean = 0, meanBefore = 0;
  for (size_t i = 0; i < out.size(); ++i) {
    before += std::pow(static_cast<double>(image[1][i]) - 1, 2);
    after += std::pow(static_cast<double>(out[1][i]) - 1, 2);
    mean += static_cast<double>(out[1][i]);
    meanBefore += static_cast<double>(image[1][i]);
  }
  CHECK(after < 0.05 * before);
  CHECK(mean == doctest::Approx(meanBefore).epsilon(0.01));
}

TEST_CASE("kpn: linear in the irradiance where no test fails") {
  const Size size{67, 41};
  const Rgb<float> a = randomImage(size, 2), b = randomImage(size, 3);
  Rgb<float> sum = a;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < sum.size(); ++i) sum[c][i] = 2 * a[c][i] + b[c][i];
  const KpnFeatures features = randomFeatures(size, 4);
  const Plane<float> large(size.width, size.height, 1e9f);
  const auto filtered = [&](const Rgb<float>& image) { return kpnFiltered(image, large, features, someTests()); };
  const Rgb<float> fa = filtered(a), fb = filtered(b), fs = filtered(sum);
  double worst = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < sum.size(); ++i)
      worst = std::max(worst, std::abs(static_cast<double>(fs[c][i] - (2 * fa[c][i] + fb[c][i]))));
  CHECK(worst < 1e-4);
}

TEST_CASE("kpn: without noise nothing that differs is mixed") {
  const Size size{67, 41};
  const Rgb<float> image = randomImage(size, 6);
  double last = 1e9;
  for (const float variance : {1e-2f, 1e-4f, 1e-6f, 0.0f}) {
    const Rgb<float> out =
        kpnFiltered(image, Plane<float>(size.width, size.height, variance), randomFeatures(size, 7), someTests());
    double error = 0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < out.size(); ++i)
        error += std::pow(static_cast<double>(out[c][i]) - static_cast<double>(image[c][i]), 2);
    CHECK(error <= last);
    last = error;
  }
  CHECK(last < 1e-3 * static_cast<double>(image.size()));
}

TEST_CASE("kpn: planes are finite and of order 1 for any light and any features") {
  const Size size{24, 16};
  for (const float scale : {0.0f, 1e-9f, 1.0f, 1e9f}) {
    Rgb<float> image = randomImage(size, 8);
    for (size_t c = 0; c < 3; ++c)
      for (float& v : image[c].data) v *= scale;
    Features features;
    features.albedo.mean = Rgb<float>(size.width, size.height, scale);
    features.normal.mean = Rgb<float>(size.width, size.height, -scale);
    features.depth.mean = Plane<float>(size.width, size.height, scale);
    for (const Features* f : {static_cast<const Features*>(nullptr), static_cast<const Features*>(&features)}) {
      const KpnPlanes planes = kpnPlanes(image, {f, Rgb<float>(size.width, size.height, scale), 4}, true);
      for (const Plane<float>& plane : planes.input)
        for (const float v : plane.data) CHECK(std::abs(v) < 16);
    }
  }
}

TEST_CASE("kpn: the same bits for any number of threads, and a better image") {
  std::string reason;
  const auto method = make_kpn();
  if (!openConvolutions(reason)) {
    MESSAGE("left out: " << reason);
    return;
  }
  const Case c = makeCase(sized(96, 64, 8));
  const MethodInputs in = inputsOf(c);
  MethodResult one, many;
  withThreads(1, [&] { one = method->run(in); });
  withThreads(3, [&] { many = method->run(in); });
  CHECK(identical(one.image.mean, many.image.mean));
  CHECK(identical(one.image.half[1], many.image.half[1]));
  CHECK(meanSquaredError(one.image.mean, c.truth) < 0.5 * meanSquaredError(in.unbiased->mean, c.truth));
}

}  // namespace braid::test_kpn
