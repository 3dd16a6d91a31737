// SPDX-License-Identifier: Apache-2.0
// Ensemble denoising: the closed form, the objective and its published constants, the filter of the weights, and what
// the method makes of synthetic renders.
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include "combiners/ensemble/ensemble_weights.h"
#include "combiners/pipeline/registry.h"
#include "combiners/ensemble/relative_weights.h"
#include "combiners/ensemble/weight_bilateral.h"
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

bool onSimplex(const WeightMaps& maps, size_t c) {
  for (size_t i = 0; i < maps.planes[0].size(); ++i) {
    double sum = 0;
    for (size_t b = 0; b < maps.bases; ++b) {
      if (maps.of(b, c)[i] < 0) return false;
      sum += static_cast<double>(maps.of(b, c)[i]);
    }
    if (std::fabs(sum - 1) > 2e-6) return false;
  }
  return true;
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

TEST_CASE("Filtered weights stay on the simplex, halves average to the mean, and maps are the weights") {
  const Case c = makeCase();
  const MethodInputs in = inputsOf(c);
  for (const bool shared : {false, true}) {
    const WeightMaps raw = ensembleWeights(*in.unbiased, in.bases, {.patchRadius = 3, .shared = shared});
    const WeightMaps maps = filteredWeights(raw, weightedEstimate(raw, in.bases), in.features);
    for (size_t ch = 0; ch < 3; ++ch) {
      CHECK(onSimplex(raw, ch));
      CHECK(onSimplex(maps, ch));
    }
    CHECK(maps.channels == (shared ? 1 : 3));
  }
  const MethodResult r = make_ensemble()->run(in);
  REQUIRE(r.aovs.size() == 3);
  CHECK(r.aovs[0].name == "weight.ensemble.narrow");
  const Estimate& e = r.image;
  for (size_t i = 0; i < e.mean.size(); ++i)
    CHECK(std::fabs(e.mean[0][i] - 0.5f * (e.half[0][0][i] + e.half[1][0][i])) < 1e-5f * (1 + e.mean[0][i]));
}

TEST_CASE("Blocks share the weights of their first pixel") {
  CaseOptions o;
  o.width = 150;  // more than a tile, and no multiple of 4
  o.height = 37;
  const Case c = makeCase(o);
  const MethodInputs in = inputsOf(c);
  for (const bool shared : {false, true}) {
    const WeightMaps all = ensembleWeights(*in.unbiased, in.bases, {.shared = shared});
    for (const int stride : {2, 4}) {
      const WeightMaps blocks = ensembleWeights(*in.unbiased, in.bases, {.stride = stride, .shared = shared});
      // Problems are solved together and stop together, so that another company ends a little nearer to the minimum.
      float worst = 0;
      for (size_t m = 0; m < all.planes.size(); ++m)
        for (int y = 0; y < o.height; ++y)
          for (int x = 0; x < o.width; ++x)
            worst = std::max(worst,
                             std::fabs(blocks.planes[m].at(x, y) - all.planes[m].at(x - x % stride, y - y % stride)));
      CHECK(worst < 1e-3f);
      CHECK(blocks.planes[0].at(stride, 0) != all.planes[0].at(stride + 1, 0));
    }
  }
}

TEST_CASE("Relative errors: the scale of a pixel, and no bright pixel decides for the dark ones around it") {
  Rgb<float> guide(5, 4, 0.5f), variance(5, 4, 0.2f);
  for (size_t ch = 0; ch < 3; ++ch) guide[ch].at(1, 0) = 2;
  const Plane<float> roots = relativeErrorRoots(guide, variance);
  CHECK(roots.at(4, 3) == doctest::Approx(1 / std::sqrt(0.25 + 0.01 + 0.3 * 0.2)));
  const double level = 0.5 * (2 + (5 * 0.5 + 2) / 6);  // its own and that of 3x2 pixels at the border
  CHECK(roots.at(1, 0) == doctest::Approx(1 / std::sqrt(level * level + 0.01 + 0.3 * 0.2)));

  // One base is right but for a lamp of 3x3 pixels, the other about the lamp only. Three of its pixels are in the
  // patch.
  const Case c = makeCase();
  const auto image = [&](float around, float lamp) {
    Rgb<float> out(c.truth.width(), c.truth.height(), around);
    for (size_t ch = 0; ch < 3; ++ch)
      for (int y = 19; y <= 21; ++y)
        for (int u = 28; u <= 30; ++u) out[ch].at(u, y) = lamp;
    return out;
  };
  const auto exactly = [&](float around, float lamp) {
    Estimate e = c.pt();
    e.mean = e.half[0] = e.half[1] = image(around, lamp);
    e.variance = image(0, 0);
    return e;
  };
  const Estimate x = exactly(0.1f, 2), lamp = exactly(0.4f, 2), dark = exactly(0.1f, 0.1f);
  MethodInputs in = inputsOf(c);
  in.unbiased = &x;
  in.features = nullptr;
  in.bases = {&lamp, &dark};
  in.options.set("ensemble-filter", 0);
  const auto beside = [&](double relative) {
    in.options.set("ensemble-relative", relative);
    return make_ensemble()->run(in).image.mean[0].at(33, 20);
  };
  CHECK(beside(1) < 0.2f);
  CHECK(beside(0) > 0.28f);
}

TEST_CASE("The filter of weights is the formula near corners and where tiles meet") {
  CaseOptions o;
  o.width = 70;
  o.height = 38;
  const Case c = makeCase(o);
  const MethodInputs in = inputsOf(c);
  const WeightMaps raw = ensembleWeights(*in.unbiased, in.bases, {.patchRadius = 0});
  const Estimate z = weightedEstimate(raw, in.bases);
  const WeightMaps maps = filteredWeights(raw, z, in.features);
  REQUIRE(maps.bases == 3);
  const auto spread = [&](size_t i) {
    double v = 0;
    for (size_t k = 0; k < 3; ++k)
      v += 0.5 * sqr(static_cast<double>(z.half[0][k][i] - z.half[1][k][i])) +
           0.5e-6 * sqr(static_cast<double>(z.mean[k][i]));
    return v + 0.5e-10;
  };
  for (const auto& [px, py] : {std::pair{2, 1}, {63, 31}, {64, 32}, {60, 35}, {69, 37}}) {
    const size_t p = z.mean[0].index(px, py);
    double sums[3] = {}, norm = 0;
    for (int y = std::max(0, py - 7); y <= std::min(o.height - 1, py + 7); ++y)
      for (int x = std::max(0, px - 7); x <= std::min(o.width - 1, px + 7); ++x) {
        const size_t q = z.mean[0].index(x, y);
        double dz = 0, da = 0, dn = 0;
        for (size_t k = 0; k < 3; ++k) {
          dz += sqr(static_cast<double>(z.mean[k][p] - z.mean[k][q]));
          da += sqr(static_cast<double>(in.features->albedo.mean[k][p] - in.features->albedo.mean[k][q]));
          dn += sqr(static_cast<double>(in.features->normal.mean[k][p] - in.features->normal.mean[k][q]));
        }
        const double e = ((x - px) * (x - px) + (y - py) * (y - py)) / 18.0 + dz / (spread(p) + spread(q)) / 8 +
                         da / (2 * 0.25 * 0.25) + dn / (2 * 0.15 * 0.15);
        for (size_t b = 0; b < 3; ++b) sums[b] += std::exp(-e) * static_cast<double>(raw.of(b, 2)[q]);
        norm += std::exp(-e);
      }
    for (size_t b = 0; b < 3; ++b)
      CHECK(static_cast<double>(maps.of(b, 2)[p]) == doctest::Approx(sums[b] / norm).epsilon(1e-4));
  }
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
