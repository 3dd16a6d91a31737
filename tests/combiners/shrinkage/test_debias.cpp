// SPDX-License-Identifier: Apache-2.0
// Photon maps less the bias that they tell.
#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

#include <doctest/doctest.h>

#include "combiners/shrinkage/debias.h"
#include "combiners/statistics/half_statistics.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/render_fixture.h"

namespace braid::test_debias {

using namespace test;

namespace {

constexpr int kWidth = 60, kHeight = 40;

Rgb<float> flat(float value) { return Rgb<float>(kWidth, kHeight, value); }

// A photon map of 16 passes that tells this bias of all samples and of its halves.
Estimate photonMap(float value, const Rgb<float>& biasA, const Rgb<float>& biasB, float biasVariance) {
  Estimate s;
  s.name = "sppm";
  s.unbiased = false;
  s.passes = 16;
  s.mean = s.half[0] = s.half[1] = flat(value);
  s.quarter.assign(4, s.mean);
  s.variance = flat(1e-4f);
  s.biasHalf[0] = biasA;
  s.biasHalf[1] = biasB;
  s.bias = average(biasA, biasB);
  s.biasVariance = flat(biasVariance);
  return s;
}

Rgb<float> normal(float mean, float deviation, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> distribution(mean, deviation);
  Rgb<float> out = flat(0);
  for (Plane<float>& plane : out.channel)
    for (float& v : plane.data) v = distribution(random);
  return out;
}

double meanSquare(const Rgb<float>& image, float about) {
  double sum = 0;
  for (const Plane<float>& plane : image.channel)
    for (const float v : plane.data) sum += sqr(static_cast<double>(v - about));
  return sum / (3 * static_cast<double>(image.size()));
}

bool unchanged(const Estimate& a, const Estimate& b) {
  return sameBits(a.mean, b.mean) && sameBits(a.half[1], b.half[1]) && sameBits(a.quarter[2], b.quarter[2]) &&
         sameBits(a.variance, b.variance) && sameBits(a.bias, b.bias) && sameBits(a.biasVariance, b.biasVariance);
}

SceneData mattPool() {
  SceneData data = loadGltf((std::filesystem::path(BRAID_SOURCE_DIR) / "scenes/pool.glb").string());
  for (Material& m : data.materials)  // the tiles' gloss would add fireflies
    if (m.transmission == 0 && m.metallic == 0) m.specular = 0;
  return data;
}

}  // namespace

TEST_CASE("A bias that is told without noise goes, from halves and quarters as from the mean, and half of it is told") {
  const Estimate s = photonMap(1.25f, flat(0.3f), flat(0.2f), 0);
  const Estimate out = debiased(s);
  CHECK(out.mean[0][700] == doctest::Approx(1));
  CHECK(out.half[0][1][700] == doctest::Approx(0.95));
  CHECK(out.half[1][1][700] == doctest::Approx(1.05));
  CHECK(out.quarter[2][2][700] == doctest::Approx(0.95));
  CHECK(out.quarter[3][2][700] == doctest::Approx(1.05));
  CHECK(out.variance[0][700] == s.variance[0][700]);
  CHECK(out.bias[0][700] == doctest::Approx(0.125));
  // Without the halves' estimates that of the mean goes for both.
  Estimate old = s;
  for (Rgb<float>& half : old.biasHalf) half = Rgb<float>();
  CHECK(debiased(old).half[0][1][700] == doctest::Approx(1));
}

TEST_CASE("As much of a told bias goes as stands out of its noise, and the noise it brings is told") {
  // Normal noise in both halves, of deviation sqrt(2) d, so that the mean's variance is d². Sums over 7200 values.
  constexpr float d = 0.1f;
  for (const float bias : {0.0f, 0.1f, 0.4f}) {
    const Estimate s =
        photonMap(1 + bias, normal(bias, std::sqrt(2.0f) * d, 1), normal(bias, std::sqrt(2.0f) * d, 2), d * d);
    const Estimate out = debiased(s);
    const double before = sqr(static_cast<double>(bias)), after = meanSquare(out.mean, 1);
    const auto noise = static_cast<double>(d * d), best = before * noise / (before + noise);
    double told = 0;
    for (const Plane<float>& plane : out.variance.channel)
      for (const float v : plane.data)
        told += static_cast<double>(v - 1e-4f) / (3 * static_cast<double>(out.mean.size()));
    CAPTURE(bias);
    MESSAGE("squared error ", before, " -> ", after, ", at best ", best, "; noise told ", told);
    // Of 75 values the mean of B² - V deviates by 0.16 V and 0.02 of it passes for a bias.
    CHECK(after < 1.1 * best + 0.05 * noise);
    const double a = before / (before + noise);
    CHECK(told == doctest::Approx(sqr(a) * noise).epsilon(0.1).scale(0.5 * noise));
    // The halves show that noise.
    double across = 0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < out.mean.size(); ++i)
        across += sqr(static_cast<double>(out.half[0][c][i] - out.half[1][c][i])) / 4;
    CHECK(across / (3 * static_cast<double>(out.mean.size())) == doctest::Approx(told).epsilon(0.1).scale(0.5 * noise));
  }
}

TEST_CASE("No pixel is taken more than it has, and what is not known well enough is left alone") {
  Estimate s = photonMap(0.2f, flat(0.3f), flat(0.3f), 0);
  CHECK(debiased(s).mean[1][99] == doctest::Approx(0).scale(1e-6));
  s.mean = s.half[0] = s.half[1] = flat(-0.1f);  // of another renderer
  CHECK(sameBits(debiased(s).mean, s.mean));
  s = photonMap(1, flat(0.3f), flat(0.3f), 0);
  s.passes = 3;
  CHECK(unchanged(debiased(s), s));
  s.passes = 16;
  s.biasVariance = flat(std::numeric_limits<float>::max());
  CHECK(sameBits(debiased(s).mean, s.mean));
  s.bias = s.biasVariance = Rgb<float>();
  CHECK(unchanged(debiased(s), s));
  for (const float extreme : {1e-30f, 1e30f}) {
    const Estimate e = debiased(photonMap(extreme, flat(extreme), flat(extreme / 2), extreme));
    for (const Rgb<float>* image : {&e.mean, &e.half[0], &e.variance, &e.bias, &e.biasVariance})
      CHECK(std::isfinite((*image)[0][5]));
  }
}

TEST_CASE("Under a caustic the error falls, and is told") {
  const Scene scene(mattPool());
  Settings settings = settingsFor(48, 27, 256);
  settings.crop = PixelWindow{12, 13, 36, 21};
  settings.integrators = {"sppm"};
  // The reference has a third of the radius and 40 times the photons.
  settings.seed = 99;
  settings.photons = 40000;
  settings.photonRadius = 5.0f / 3;
  const RenderResult reference = render(scene, settings);
  settings.photonRadius = 5;
  settings.photons = 20000;
  settings.spp = 64;
  double before = 0, after = 0, told = 0;
  for (uint64_t seed = 1; seed <= 2; ++seed) {
    settings.seed = seed;
    const RenderResult r = render(scene, settings);
    const Estimate& s = estimateOf(r);
    const Estimate out = debiased(s);
    const Rgb<float>& truth = estimateOf(reference).mean;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < truth.size(); ++i) {
        const auto value = static_cast<double>(truth[c][i]);
        before += sqr(static_cast<double>(s.mean[c][i]) - value);
        after += sqr(static_cast<double>(out.mean[c][i]) - value);
        told += static_cast<double>(out.variance[c][i]) +
                2 * (sqr(static_cast<double>(out.bias[c][i])) - static_cast<double>(out.biasVariance[c][i]));
      }
  }
  MESSAGE("squared error without the told bias / with it: ", after / before, "; told / true: ", told / after);
  CHECK(after < 0.9 * before);
  CHECK(told > 0.5 * after);
  CHECK(told < 2 * after);
}

}  // namespace braid::test_debias
