// SPDX-License-Identifier: Apache-2.0
// Ensemble denoising: the closed form, the objective and its published constants, and what the method makes of
// synthetic renders.
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include "combiners/ensemble/ensemble_weights.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_ensemble {

using namespace test;

namespace {

// One pixel with halves a and b in all channels.
Estimate pixel(float a, float b) {
  Estimate e;
  e.half[0] = Rgb<float>(1, 1, a);
  e.half[1] = Rgb<float>(1, 1, b);
  e.mean = Rgb<float>(1, 1, 0.5f * (a + b));
  e.variance = Rgb<float>(1, 1, 0.25f * (a - b) * (a - b));
  return e;
}

std::vector<const Estimate*> pointers(const std::vector<Estimate>& list) {
  std::vector<const Estimate*> out;
  for (const Estimate& e : list) out.push_back(&e);
  return out;
}

MethodResult runWith(const char* option, double value, const MethodInputs& in) {
  MethodInputs copy = in;
  if (option) copy.options.set(option, value);
  return make_ensemble()->run(copy);
}

}  // namespace

TEST_CASE("Two denoisers: the weight is the closed form and the best of a grid") {
  std::mt19937 random(1);
  std::normal_distribution<float> gauss;
  for (int trial = 0; trial < 200; ++trial) {
    const Estimate x = pixel(gauss(random), gauss(random));
    const std::vector<Estimate> y = {pixel(gauss(random), gauss(random)), pixel(gauss(random), gauss(random))};
    const WeightMaps w = ensembleWeights(x, pointers(y), {.patchRadius = 0});
    const auto at = [](const Estimate& e, int h) { return static_cast<double>(e.half[h][0][0]); };
    const double xa = at(x, 0), xb = at(x, 1), a1 = at(y[0], 0), b1 = at(y[0], 1), a2 = at(y[1], 0), b2 = at(y[1], 1);
    const double alpha = std::clamp(
        ((a1 - xb) * (a1 - a2) + (b1 - xa) * (b1 - b2)) / ((a1 - a2) * (a1 - a2) + (b1 - b2) * (b1 - b2)), 0.0, 1.0);
    CHECK(static_cast<double>(w.of(1, 0)[0]) == doctest::Approx(alpha).epsilon(1e-5));
    // The objective of the halves themselves, not the matrix.
    double best = 1e300, bestAlpha = 0;
    for (int k = 0; k <= 1000; ++k) {
      const double t = k / 1000.0, ea = (1 - t) * a1 + t * a2 - xb, eb = (1 - t) * b1 + t * b2 - xa;
      if (ea * ea + eb * eb < best) best = ea * ea + eb * eb, bestAlpha = t;
    }
    CHECK(std::fabs(static_cast<double>(w.of(1, 0)[0]) - bestAlpha) < 6e-4);
  }
}

// What EnsembleChoices::prior states, on a grid: with noise, the pull towards equal weights; without, none.
TEST_CASE("Noise of the unbiased image draws weights towards equal ones, as the prior says") {
  std::mt19937 random(2);
  std::normal_distribution<float> gauss;
  for (int trial = 0; trial < 200; ++trial) {
    Estimate x = pixel(gauss(random), gauss(random));
    const float variance = trial % 4 == 0 ? 0.0f : std::exp(gauss(random) - 2);  // of the mean
    x.variance = Rgb<float>(1, 1, variance);
    const std::vector<Estimate> y = {pixel(gauss(random), gauss(random)), pixel(gauss(random), gauss(random))};
    const WeightMaps w = ensembleWeights(x, pointers(y), {.patchRadius = 0, .prior = 6});
    const auto at = [](const Estimate& e, int h) { return static_cast<double>(e.half[h][0][0]); };
    double best = 1e300, bestAlpha = 0;
    for (int k = 0; k <= 1000; ++k) {
      const double t = k / 1000.0, ea = (1 - t) * at(y[0], 0) + t * at(y[1], 0) - at(x, 1),
                   eb = (1 - t) * at(y[0], 1) + t * at(y[1], 1) - at(x, 0),
                   pull = 6 * 2 * static_cast<double>(variance) * (sqr(t - 0.5) + sqr(0.5 - t));
      if (ea * ea + eb * eb + pull < best) best = ea * ea + eb * eb + pull, bestAlpha = t;
    }
    CHECK(std::fabs(static_cast<double>(w.of(1, 0)[0]) - bestAlpha) < 6e-4);
  }
  // Among three bases of which two are far off, the noise of x has to be large to matter.
  Estimate x = pixel(1, 1);
  const std::vector<Estimate> y = {pixel(1, 1), pixel(3, 3), pixel(-2, -2)};
  x.variance = Rgb<float>(1, 1, 1e-6f);
  CHECK(ensembleWeights(x, pointers(y), {.patchRadius = 0, .prior = 6}).of(0, 0)[0] > 0.99f);
  x.variance = Rgb<float>(1, 1, 1e6f);
  for (size_t b = 0; b < 3; ++b)
    CHECK(ensembleWeights(x, pointers(y), {.patchRadius = 0, .prior = 6}).of(b, 0)[0] ==
          doctest::Approx(1.0 / 3).epsilon(1e-3));
}

TEST_CASE("Errors of whole images: the minimum, or the better end, of the reduced objective on a grid") {
  std::mt19937 random(5);
  std::normal_distribution<float> gauss;
  int ends = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Estimate x = pixel(gauss(random), gauss(random));
    const std::vector<Estimate> y = {pixel(gauss(random), gauss(random)), pixel(gauss(random), gauss(random))};
    const WeightMaps w = ensembleWeights(x, pointers(y), {.patchRadius = 0, .fullError = true});
    const auto objective = [&](double t) {
      const auto z = [&](int h) {
        return (1 - t) * static_cast<double>(y[0].half[h][0][0]) + t * static_cast<double>(y[1].half[h][0][0]);
      };
      const auto half = [&](int h) { return static_cast<double>(x.half[h][0][0]); };
      return 0.5 * (sqr(z(0) - half(1)) + sqr(z(1) - half(0))) - 0.25 * sqr(z(0) - z(1));
    };
    double best = 1e300;
    for (int k = 0; k <= 1000; ++k) best = std::min(best, objective(k / 1000.0));
    const auto found = static_cast<double>(w.of(1, 0)[0]);
    CHECK(objective(found) < best + 1e-5);
    ends += found == 0 || found == 1 ? 1 : 0;
  }
  CHECK(ends > 20);
  CHECK(ends < 180);
}

TEST_CASE("Twice the objective is the sum of both squares less (x_A - x_B)², not twice that") {
  // wᵀ<M>w by the definition of <M> for one pixel, against Eq. (25) with the factor corrected.
  const double xa = 1.3, xb = 0.4, ya[2] = {0.9, 1.6}, yb[2] = {0.7, 1.1}, w[2] = {0.3, 0.7};
  double definition = 0;
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) {
      const double a = xa * xb - xb * (ya[i] + ya[j]) + ya[i] * ya[j],
                   b = xa * xb - xa * (yb[i] + yb[j]) + yb[i] * yb[j];
      definition += w[i] * w[j] * 0.5 * (a + b);
    }
  const double za = w[0] * ya[0] + w[1] * ya[1], zb = w[0] * yb[0] + w[1] * yb[1];
  CHECK(2 * definition == doctest::Approx(sqr(za - xb) + sqr(zb - xa) - sqr(xa - xb)));
  CHECK(2 * definition != doctest::Approx(sqr(za - xb) + sqr(zb - xa) - 2 * sqr(xa - xb)));
  // And the weights that the code finds minimise exactly that.
  const std::vector<Estimate> y = {pixel(0.9f, 0.7f), pixel(1.6f, 1.1f)};
  const WeightMaps found = ensembleWeights(pixel(1.3f, 0.4f), pointers(y), {.patchRadius = 0});
  const double t = static_cast<double>(found.of(1, 0)[0]);
  const auto objective = [&](double s) {
    return sqr((1 - s) * ya[0] + s * ya[1] - xb) + sqr((1 - s) * yb[0] + s * yb[1] - xa);
  };
  for (const double s : {t - 0.01, t + 0.01})
    if (s >= 0 && s <= 1) CHECK(objective(t) < objective(s));
}

TEST_CASE("Identical denoisers get equal weights, and their image comes back") {
  const Case c = makeCase();
  MethodInputs in = inputsOf(c);
  in.bases = {&c.find("narrow"), &c.find("narrow")};
  const MethodResult r = make_ensemble()->run(in);
  for (const float w : r.aovs[0].plane.data) CHECK(w == doctest::Approx(0.5f).epsilon(1e-6));
  CHECK(meanSquaredError(r.image.mean, c.find("narrow").mean) < 1e-12);
}

TEST_CASE("A denoiser that knows the truth gets nearly all weight") {
  const Case c = makeCase();
  Estimate exact = c.find("wide");
  exact.mean = exact.half[0] = exact.half[1] = c.truth;
  MethodInputs in = inputsOf(c);
  Estimate black = exact;
  black.mean = black.half[0] = black.half[1] = Rgb<float>(c.options.width, c.options.height);
  in.bases = {&black, &exact};
  CHECK(meanSquaredError(make_ensemble()->run(in).image.mean, c.truth) < 0.1 * meanSquaredError(c.pt().mean, c.truth));
}

TEST_CASE("An ensemble is no worse than its best base at 64 samples, better than the mean, and knows its error") {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.samples = 64;
  double estimated = 0, actual = 0;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    o.seed = seed;
    const Case c = makeCase(o);
    const MethodInputs in = inputsOf(c);
    double best = 1e300;
    for (const Estimate* b : in.bases) best = std::min(best, meanSquaredError(b->mean, c.truth));
    const MethodResult r = make_ensemble()->run(in);
    const double error = meanSquaredError(r.image.mean, c.truth);
    MESSAGE("best base ", best, ", ensemble ", error, ", patch 1 ",
            meanSquaredError(runWith("ensemble-patch", 1, in).image.mean, c.truth), ", average ",
            meanSquaredError(make_average()->run(in).image.mean, c.truth));
    CHECK(error < 1.02 * best);
    CHECK(error < meanSquaredError(make_average()->run(in).image.mean, c.truth));
    CHECK(error < meanSquaredError(runWith("ensemble-patch", 1, in).image.mean, c.truth));
    for (const float e : r.error.data) estimated += static_cast<double>(e);
    actual += error * static_cast<double>(r.error.size());
  }
  MESSAGE("estimated error over actual: ", estimated / actual);
  CHECK(estimated > 0.4 * actual);
  CHECK(estimated < 2.5 * actual);
}

TEST_CASE("Options: unfiltered, shared, signed weights and full errors run, and few passes mean equal weights") {
  const Case c = makeCase();
  const MethodInputs in = inputsOf(c);
  const MethodResult usual = make_ensemble()->run(in);
  for (const auto& [name, value] : {std::pair{"ensemble-filter", 0.0},
                                    {"ensemble-shared", 1.0},
                                    {"ensemble-non-negative", 0.0},
                                    {"ensemble-full-error", 1.0}}) {
    const MethodResult r = runWith(name, value, in);
    CAPTURE(std::string(name));
    CHECK(allFinite(r.image.mean));
    CHECK_FALSE(identical(r.image.mean, usual.image.mean));
    CHECK(meanSquaredError(r.image.mean, c.truth) < meanSquaredError(c.pt().mean, c.truth));
  }
  // A target outside the segment of both bases: only signed weights reach it.
  const std::vector<Estimate> y = {pixel(1, 1), pixel(2, 2)};
  CHECK(ensembleWeights(pixel(4, 4), pointers(y), {.patchRadius = 0}).of(1, 0)[0] == 1);
  const WeightMaps w = ensembleWeights(pixel(4, 4), pointers(y), {.patchRadius = 0, .nonNegative = false});
  CHECK(w.of(0, 0)[0] == doctest::Approx(-2));
  CHECK(w.of(1, 0)[0] == doctest::Approx(3));
  CaseOptions few;
  few.samples = 4;
  const Case f = makeCase(few);
  const MethodResult r = make_ensemble()->run(inputsOf(f));
  CHECK(meanSquaredError(r.image.mean, make_average()->run(inputsOf(f)).image.mean) < 1e-12);
  REQUIRE(r.remarks.size() == 1);
  CHECK(r.remarks[0].name == "weights");
}

}  // namespace braid::test_ensemble
