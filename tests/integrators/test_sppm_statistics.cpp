// SPDX-License-Identifier: Apache-2.0
// What photon mapping says about its own error is true, and the error falls as theory has it.
//
// Theory (Knaus and Zwicker 2011): with radii r_i² ∝ i^(-1/3) the variance of the mean of n passes goes as
// n⁻² Σ i^(1/3) and its bias as n⁻¹ Σ i^(-1/3): the mean squared error falls as n^(-2/3) in the end, and between 16 and
// 256 passes by slopes of -0.70 (noise) and -0.55 (bias) in the logarithm.
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/statistics/error_map.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/render_fixture.h"

namespace braid::test_sppm_statistics {

using namespace test;

namespace {

double average(const Rgb<float>& planes) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c)
    for (const float v : planes[c].data) sum += static_cast<double>(v);
  return sum / (3 * static_cast<double>(planes.size()));
}

double average(const Plane<float>& plane) {
  double sum = 0;
  for (const float v : plane.data) sum += static_cast<double>(v);
  return sum / static_cast<double>(plane.size());
}

// Mean squared distance to a reference, without the reference's own variance.
double distance2(const Rgb<float>& image, const Estimate& reference) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < image.size(); ++i)
      sum += sqr(static_cast<double>(image[c][i]) - static_cast<double>(reference.mean[c][i]));
  return sum / (3 * static_cast<double>(image.size())) - average(reference.variance);
}

struct Errors {
  double truth = 0, estimated = 0;
};

// Averages over seeds of the squared error and of what the estimate says about it.
Errors errorsOf(const Scene& scene, Settings settings, uint64_t passes, uint64_t seeds, const Estimate& reference) {
  Errors e;
  settings.spp = passes;
  for (uint64_t seed = 0; seed < seeds; ++seed) {
    settings.seed = seed;
    const RenderResult r = render(scene, settings);
    e.truth += distance2(r.image, reference) / static_cast<double>(seeds);
    e.estimated += average(errorMap(estimateOf(r))) / static_cast<double>(seeds);
  }
  return e;
}

double slope(const Errors& from, const Errors& to, double factor) {
  return std::log(to.truth / from.truth) / std::log(factor);
}

void checkCovers(const std::string& name, const Errors& e) {
  MESSAGE(name, ": squared error ", e.truth, ", estimated ", e.estimated, ", ratio ", e.estimated / e.truth);
  CHECK(e.estimated > 0.5 * e.truth);
  CHECK(e.estimated < 2 * e.truth);
}

// The Cornell box below its light, whose rim is noise of another kind.
Settings cornellSettings() {
  Settings s = settingsFor(32, 32, 1);
  s.crop = PixelWindow{0, 12, 32, 32};
  return s;
}

// A part of the water.
Settings poolSettings() {
  Settings s = settingsFor(48, 27, 1);
  s.crop = PixelWindow{12, 13, 36, 21};
  return s;
}

}  // namespace

TEST_CASE("sppm statistics: on the Cornell box the error falls at the rate of theory, and is estimated") {
  const Scene scene(cornellBox());
  Settings settings = cornellSettings();
  settings.spp = 2048;
  settings.seed = 99;
  const RenderResult reference = render(scene, settings);
  settings.integrators = {"sppm"};
  for (const bool direct : {false, true}) {
    settings.photonDirect = direct;
    const std::string name = direct ? "cornell, photons alone" : "cornell";
    const Errors few = errorsOf(scene, settings, 16, 6, estimateOf(reference));
    const Errors many = errorsOf(scene, settings, 256, 3, estimateOf(reference));
    checkCovers(name + ", 16 passes", few);
    checkCovers(name + ", 256 passes", many);
    const double rate = slope(few, many, 16);
    MESSAGE(name, ": slope ", rate);
    CHECK(rate < -0.5);
    CHECK(rate > -0.85);
  }
}

TEST_CASE("sppm statistics: on the caustics of the pool the error falls at the rate of theory, and is estimated") {
  SceneData data = loadGltf(sourcePath("scenes/pool.glb"));
  // Matt tiles: their gloss shows the sun through the water to a few paths, whose fireflies would need many more seeds.
  for (Material& m : data.materials)
    if (m.transmission == 0 && m.metallic == 0) m.specular = 0;
  const Scene scene(std::move(data));
  // No other integrator finds these caustics: the reference is the same method with 40 times the photons and a third
  // of the radius, whose bias is a hundredth.
  Settings settings = poolSettings();
  settings.integrators = {"sppm"};
  settings.spp = 256;
  settings.seed = 99;
  settings.photons = 40000;
  settings.photonRadius = 1.6f;
  const RenderResult reference = render(scene, settings);
  settings.photonRadius = 5;
  settings.photons = 1000;
  const Errors few = errorsOf(scene, settings, 8, 8, estimateOf(reference));
  const Errors many = errorsOf(scene, settings, 128, 4, estimateOf(reference));
  checkCovers("pool, 8 passes", few);
  checkCovers("pool, 128 passes", many);
  const double rate = slope(few, many, 16);
  MESSAGE("pool: slope ", rate);
  CHECK(rate < -0.5);
  CHECK(rate > -0.9);

  // Many photons, so that the bias matters.
  settings.photons = 20000;
  const Errors biased = errorsOf(scene, settings, 64, 1, estimateOf(reference));
  checkCovers("pool, 20 000 photons", biased);
}

TEST_CASE("sppm statistics: the reported variance is that over seeds") {
  // As in the calibration test of path tracing: Σ reported / Σ empirical over pixels, channels and 64 seeds, paths
  // clamped at radiance 1 because of the light's rim.
  const Scene scene(cornellBox());
  constexpr uint64_t kSeeds = 64;
  for (const auto& [sampler, spp] : {std::pair(SamplerKind::Independent, 16), std::pair(SamplerKind::Independent, 48),
                                     std::pair(SamplerKind::Sobol, 16)}) {
    Settings settings = settingsFor(16, 16, static_cast<uint64_t>(spp), sampler);
    settings.integrators = {"sppm"};
    settings.clamp = 1;
    settings.photons = 400;
    Rgb<double> sum(16, 16), squares(16, 16);
    double reported = 0, empirical = 0, biasReported = 0, biasEmpirical = 0;
    Rgb<double> biasSum(16, 16), biasSquares(16, 16);
    for (uint64_t seed = 0; seed < kSeeds; ++seed) {
      settings.seed = seed;
      const RenderResult r = render(scene, settings);
      const Estimate& e = estimateOf(r);
      reported += average(e.variance) / kSeeds;
      biasReported += average(e.biasVariance) / kSeeds;
      for (size_t c = 0; c < 3; ++c)
        for (size_t i = 0; i < e.mean.size(); ++i) {
          const double v = static_cast<double>(e.mean[c][i]), b = static_cast<double>(e.bias[c][i]);
          sum[c][i] += v;
          squares[c][i] += v * v;
          biasSum[c][i] += b;
          biasSquares[c][i] += b * b;
        }
    }
    const auto variance = [&](const Rgb<double>& s, const Rgb<double>& q) {
      double total = 0;
      for (size_t c = 0; c < 3; ++c)
        for (size_t i = 0; i < s.size(); ++i) total += (q[c][i] - sqr(s[c][i]) / kSeeds) / (kSeeds - 1);
      return total / (3 * static_cast<double>(s.size()));
    };
    empirical = variance(sum, squares);
    biasEmpirical = variance(biasSum, biasSquares);
    const bool independent = sampler == SamplerKind::Independent;
    MESSAGE(std::string(independent ? "independent, " : "sobol, "), spp, " passes: reported over empirical ",
            reported / empirical, ", of the bias estimate ", biasReported / biasEmpirical);
    CHECK(reported / empirical > 0.9);
    CHECK(reported / empirical < 1.1);
    // The bias estimate's is not rescaled: conservative with low-discrepancy points.
    CHECK(biasReported / biasEmpirical > 0.9);
    CHECK(biasReported / biasEmpirical < (independent ? 1.1 : 1.6));
  }
}

TEST_CASE("error map: a biased estimate's is variance plus squared bias, an unbiased one's the variance") {
  Estimate e;
  e.mean = Rgb<float>(40, 30, 1.0f);
  e.variance = Rgb<float>(40, 30, 0.02f);
  CHECK(errorMap(e)[700] == doctest::Approx(0.02));
  // A bias that changes its sign from pixel to pixel, and no noise in it.
  e.bias = e.biasVariance = Rgb<float>(40, 30, 0.0f);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < e.bias.size(); ++i) e.bias[c][i] = i % 2 == 0 ? 0.3f : -0.3f;
  CHECK(squaredBias(e)[0] == doctest::Approx(0.09));
  CHECK(errorMap(e)[700] == doctest::Approx(0.11));
  // Nothing but noise: B² is Var B on average.
  for (size_t c = 0; c < 3; ++c) std::fill(e.biasVariance[c].data.begin(), e.biasVariance[c].data.end(), 0.1f);
  CHECK(squaredBias(e)[700] == 0);
  Estimate one;
  one.mean = one.biasVariance = Rgb<float>(1, 1);
  one.bias = Rgb<float>(1, 1, 0.5f);
  CHECK(errorMap(one)[0] == doctest::Approx(0.25));
}

}  // namespace braid::test_sppm_statistics
