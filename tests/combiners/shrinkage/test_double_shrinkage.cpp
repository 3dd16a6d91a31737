// SPDX-License-Identifier: Apache-2.0
// Double shrinkage as a method: the estimates of squared errors against true ones, and what its result promises.
#include <cmath>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/shrinkage/shrinkage_errors.h"
#include "combiners/pipeline/registry.h"
#include "combiners/shrinkage/double_shrinkage.h"
#include "combiners/statistics/surface_smooth.h"
#include "combiners/regression/radiance_prior.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_double_shrinkage {

using namespace test;

namespace {

MethodResult runDouble(const Case& c, const std::string& biased, const std::map<std::string, double>& options = {}) {
  MethodInputs in = inputsOf(c, biased);
  for (const auto& [name, value] : options) in.options.set("double-shrinkage-" + name, value);
  return make_double_shrinkage()->run(in);
}

double mean(const Plane<float>& p) {
  double sum = 0;
  for (const float v : p.data) sum += static_cast<double>(v);
  return sum / static_cast<double>(p.size());
}

const Plane<float>& aov(const MethodResult& r, const std::string& name) {
  for (const NamedPlane& p : r.aovs)
    if (p.name == name + ".double-shrinkage") return p.plane;
  static const Plane<float> none;
  return none;
}

Rgb<float> priorOf(const MethodResult& r) {
  Rgb<float> image;
  for (size_t c = 0; c < 3; ++c)
    for (const NamedPlane& p : r.aovs)
      if (p.name == std::string("prior.double-shrinkage.") + "RGB"[c]) image[c] = p.plane;
  return image;
}

}  // namespace

TEST_CASE("Priors of the halves average to the prior of all samples") {
  const Case c = makeCase(sized(40, 30, 32));
  const MethodResult r = runDouble(c, "sppm");
  const Estimate &x = c.pt(), &y = c.sppm();
  Plane<float> vu(40, 30), vb(40, 30);
  for (size_t i = 0; i < vu.size(); ++i) {
    vu[i] = x.variance[0][i] + x.variance[1][i] + x.variance[2][i];
    vb[i] = y.variance[0][i] + y.variance[1][i] + y.variance[2][i];
  }
  RegressionSettings s = stridedSettings(4, nullptr);
  s.fallbackWeight = 0;
  const Features& f = *c.estimates.features;
  const std::vector<FeatureGroup> features = {{&f.normal.mean[0], &f.normal.mean[1], &f.normal.mean[2]}};
  const Rgb<float> all = radiancePrior({&x.mean, &vu}, {&y.mean, &vb}, features, x.mean, s);
  const auto halves =
      radiancePriorHalves({&x.mean, &vu, {&x.half[0], &x.half[1]}}, {&y.mean, &vb, {&y.half[0], &y.half[1]}}, features,
                          {x.half[0], x.half[1]}, s);
  for (size_t i = 0; i < vu.size(); ++i)
    CHECK(all[1][i] == doctest::Approx(0.5 * static_cast<double>(halves[0][1][i] + halves[1][1][i])).epsilon(1e-4));
}

TEST_CASE("Error of the unbiased image: its variance averaged over channels and 13 x 13 pixels, with a floor") {
  Estimate x;
  x.mean = Rgb<float>(40, 40, 2.0f);
  Rgb<float> variance(40, 40);
  variance[0].at(20, 20) = 3 * 169.0f;
  const Plane<float> error = unbiasedError(x, variance);
  CHECK(error.at(20, 20) == doctest::Approx(1));
  CHECK(error.at(26, 14) == doctest::Approx(1));
  CHECK(error.at(27, 20) == doctest::Approx(1e-8 * (4 + 1e-4)));
}

TEST_CASE("Error of a photon map: variance plus what of the squared bias is not its noise, along surfaces only") {
  Estimate x, y;
  x.mean = y.mean = y.bias = y.biasVariance = y.variance = Rgb<float>(30, 30);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < 900; ++i) {
      y.variance[c][i] = 0.25f;
      y.bias[c][i] = i % 30 < 15 ? 0.5f : 0.1f;  // 0.25 and 0.01 squared
      y.biasVariance[c][i] = 0.05f;
    }
  const Rgb<float> noVariance(30, 30);
  Features f;
  f.albedo.mean = Rgb<float>(30, 30);
  f.normal.mean = Rgb<float>(30, 30, 1.0f);
  for (int y0 = 0; y0 < 30; ++y0)
    for (int x0 = 15; x0 < 30; ++x0) f.normal.mean[0].at(x0, y0) = -1;
  const Plane<float> error = biasedError(y, x, noVariance, &f);
  CHECK(error.at(14, 10) == doctest::Approx(0.25 + 0.25 - 0.05));
  CHECK(error.at(15, 10) == doctest::Approx(0.25));  // its square of 0.01 is less than the noise of 0.05
  // Without features the box goes across.
  const Plane<float> boxed = biasedError(y, x, noVariance, nullptr);
  CHECK(boxed.at(15, 10) > 0.26f);
  CHECK(boxed.at(15, 10) < 0.44f);
}

TEST_CASE("Errors of denoisers, of photon maps and of the prior are those measured against the truth") {
  // Ratios of image sums; the noise of such a sum at 96 x 72 pixels is some per cent.
  for (const uint64_t n : {uint64_t(32), uint64_t(128)}) {
    CaseOptions o = sized(96, 72, n);
    o.allBiasEstimated = true;
    const Case c = makeCase(o);
    for (const char* biased : {"sppm", "narrow", "wide"}) {
      Estimate y = c.find(biased);
      const double truth = meanSquaredError(y.mean, c.truth);
      const double ratio = mean(biasedError(y, c.pt(), c.pt().variance, &*c.estimates.features)) / truth;
      y.bias = y.biasVariance = Rgb<float>();
      const double across = mean(biasedError(y, c.pt(), c.pt().variance, &*c.estimates.features)) / truth;
      const MethodResult r = runDouble(c, biased, {{"debias", 0}});  // what tells all of its bias would lose all of it
      const double prior = mean(aov(r, "eta2")) / meanSquaredError(priorOf(r), c.truth);
      INFO(n, " ", std::string(biased), ": E_b ", ratio, ", across halves ", across, ", eta2 ", prior);
      CHECK(ratio == doctest::Approx(1).epsilon(0.25));
      CHECK(across == doctest::Approx(1).epsilon(0.25));
      CHECK(prior > 0.6);
      CHECK(prior < 1.6);
    }
  }
}

TEST_CASE("Residuals of the prior are limited to eight standard deviations of their surroundings") {
  const int n = 40;
  Estimate x;
  x.mean = x.half[0] = x.half[1] = Rgb<float>(n, n, 1.0f);
  const Rgb<float> prior(n, n, 1.0f), halves[2] = {prior, prior};
  Rgb<float> variance(n, n, 0.01f);
  for (size_t c = 0; c < 3; ++c) x.half[1][c].at(20, 20) = 1000;  // a firefly that the variance has not seen
  const Plane<float> error = priorError(prior, halves, x, variance, unbiasedError(x, variance));
  const double limited = (0.5 * 64 * 2 * 0.01 - 0.02 * 169) / 169;
  CHECK(static_cast<double>(error.at(20, 20)) == doctest::Approx(std::max(limited, 1e-6 * 1.01)).epsilon(1e-3));
  CHECK(error.at(20, 20) < 1e-3f);
  // A prior that is wrong everywhere is no firefly.
  const Rgb<float> wrong(n, n, 3.0f), wrongHalves[2] = {wrong, wrong};
  x.half[1] = x.half[0];
  CHECK(priorError(wrong, wrongHalves, x, variance, unbiasedError(x, variance)).at(9, 9) == doctest::Approx(3.98));
}

TEST_CASE("Double shrinkage beats its inputs and its first stage, for photon maps and denoisers, with fireflies too") {
  for (const double fireflies : {0.0, 0.0005})
    for (const char* biased : {"sppm", "narrow", "wide"}) {
      CaseOptions o = sized(96, 72, 32);
      o.fireflies = fireflies;
      const Case c = makeCase(o);
      const double x = meanSquaredError(c.pt().mean, c.truth), y = meanSquaredError(c.find(biased).mean, c.truth);
      const MethodResult r = runDouble(c, biased);
      const double both = meanSquaredError(r.image.mean, c.truth);
      const double single = meanSquaredError(runDouble(c, biased, {{"stage", 1}}).image.mean, c.truth);
      // With a photon map that knows all of its bias and keeps it.
      o.allBiasEstimated = true;
      const Case told = makeCase(o);
      const double whole = meanSquaredError(runDouble(told, biased, {{"debias", 0}}).image.mean, c.truth);
      const double wholeSingle =
          meanSquaredError(runDouble(told, biased, {{"debias", 0}, {"stage", 1}}).image.mean, c.truth);
      const double js = meanSquaredError(runDouble(c, biased, {{"prior", 1}}).image.mean, c.truth);
      const double own = meanSquaredError(runDouble(c, biased, {{"own-halves", 1}}).image.mean, c.truth);
      const double estimated = mean(r.error) / both;
      INFO(fireflies, " ", std::string(biased), ": X ", x, " Y ", y, " double ", both, " single ", single, " prior Y* ",
           js, " own halves ", own, " with the bias ", whole, " single ", wholeSingle, " estimated/true ", estimated);
      CHECK(both < 0.5 * std::min(x, y));
      CHECK(whole < 0.7 * wholeSingle);
      CHECK(both < 0.75 * single);
      CHECK(both <= whole);
      CHECK(js < single);
      CHECK(both < 1.1 * own);
      CHECK(estimated > 0.5);
      CHECK(estimated < 2);
      CHECK(
          identical(runDouble(c, biased, {{"prior", 2}}).image.mean, runDouble(c, biased, {{"stage", 1}}).image.mean));
    }
}

TEST_CASE("As the noise vanishes the result becomes X") {
  CaseOptions o = sized(48, 36, 64);
  o.noise = 0.001;
  const Case c = makeCase(o);
  for (const char* biased : {"sppm", "wide"}) {
    const double both = meanSquaredError(runDouble(c, biased).image.mean, c.truth);
    CHECK(both < 2 * meanSquaredError(c.pt().mean, c.truth));
    CHECK(both < 1e-3 * meanSquaredError(c.find(biased).mean, c.truth));
  }
}

TEST_CASE("Weights and errors are maps in range, halves have more noise than the result, and stride 1 gains little") {
  const Case c = makeCase(sized(64, 48, 32));
  const MethodResult r = runDouble(c, "sppm");
  for (const char* name : {"kappa1", "kappa2"})
    for (const float v : aov(r, name).data) {
      CHECK(v >= 0);
      CHECK(v <= 1);
    }
  for (const char* name : {"eta2", "error-unbiased", "error-biased"})
    for (const float v : aov(r, name).data) CHECK(v > 0);
  const double full = meanSquaredError(r.image.mean, c.truth);
  for (const Rgb<float>& half : r.image.half) {
    CHECK(meanSquaredError(half, c.truth) > full);
    CHECK(meanSquaredError(half, c.truth) < 3 * full);
  }
  const double one = meanSquaredError(runDouble(c, "sppm", {{"stride", 1}}).image.mean, c.truth);
  INFO("stride 4 ", full, " stride 1 ", one);
  CHECK(full < 1.08 * one);
}

TEST_CASE("Without variance, features, halves or pixels double shrinkage stays finite") {
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{7, 3}, std::pair{40, 30}}) {
    CaseOptions o = sized(width, height, 32);
    o.noise = o.photonNoise = width > 8 ? 0 : 1;
    const Case c = makeCase(o);
    for (const char* biased : {"sppm", "wide"}) {
      const MethodResult r = runDouble(c, biased);
      CHECK(allFinite(r.image.mean));
      CHECK(allFinite(r.error));
      MethodInputs in = inputsOf(c, biased);
      in.features = nullptr;
      Estimate x = c.pt(), y = c.find(biased);
      in.unbiased = &x;
      in.biased = &y;
      CHECK(allFinite(make_double_shrinkage()->run(in).image.mean));
      x.variance = Rgb<float>();
      y.half[0] = y.half[1] = Rgb<float>();
      const MethodResult plain = make_double_shrinkage()->run(in);
      CHECK(allFinite(plain.image.mean));
      CHECK(plain.image.half[0].empty());
      CHECK(aov(plain, "eta2").empty());
    }
  }
}

TEST_CASE("The joint filter is the plain weighted mean") {
  const Case c = makeCase(sized(21, 14, 8));
  const Features& f = *c.estimates.features;
  const Plane<float>& in = c.pt().variance[1];
  const Plane<float> out = surfaceSmooth({&c.pt().mean[0], &in}, &f, 3)[1];
  for (int y = 0; y < 14; ++y)
    for (int x = 0; x < 21; ++x) {
      double sum = 0, weights = 0;
      for (int j = std::max(0, y - 3); j <= std::min(13, y + 3); ++j)
        for (int i = std::max(0, x - 3); i <= std::min(20, x + 3); ++i) {
          double e = 0;
          for (size_t k = 0; k < 3; ++k) {
            e += sqr(static_cast<double>(f.albedo.mean[k].at(x, y) - f.albedo.mean[k].at(i, j))) / (2 * 0.25 * 0.25);
            e += sqr(static_cast<double>(f.normal.mean[k].at(x, y) - f.normal.mean[k].at(i, j))) / (2 * 0.15 * 0.15);
          }
          weights += std::exp(-e);
          sum += std::exp(-e) * static_cast<double>(in.at(i, j));
        }
      CHECK(static_cast<double>(out.at(x, y)) == doctest::Approx(sum / weights).epsilon(1e-4));
    }
}

TEST_CASE("The number of threads changes no bit of double shrinkage") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Case c = makeCase(sized(61, 47, 16));
  MethodResult results[3];
  size_t k = 0;
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    results[k++] = arena.execute([&] { return runDouble(c, "wide"); });
  }
  for (size_t i : {size_t(1), size_t(2)}) {
    CHECK(identical(results[0].image.mean, results[i].image.mean));
    CHECK(identical(results[0].image.half[1], results[i].image.half[1]));
    CHECK(identical(results[0].error, results[i].error));
  }
}

TEST_CASE("Lone fireflies of the unbiased image neither stay nor take their surroundings from it") {
  Case c = makeCase(sized(64, 48, 64));
  const Case without = c;
  Estimate& x = c.estimates.estimates[0];
  for (size_t ch = 0; ch < 3; ++ch) {
    x.mean[ch].at(20, 14) = 50;
    x.half[0][ch].at(20, 14) = 100;
    x.variance[ch].at(20, 14) = 50 * 50;
  }
  // The photon map keeps its bias, lest what is left of it be no more than what fireflies do.
  const auto errorOf = [](const Case& from, std::map<std::string, double> options) {
    options["debias"] = 0;
    return meanSquaredError(runDouble(from, "sppm", options).image.mean, from.truth);
  };
  const double clean = errorOf(without, {}), gated = errorOf(c, {});
  CAPTURE(clean);
  CAPTURE(gated);
  CHECK(gated < 1.2 * clean);
  // Where the prior is fitted to the unbiased image itself, fireflies and all.
  const double alone = errorOf(c, {{"fused", 0}, {"chosen", 0}});
  const double paper = errorOf(c, {{"fused", 0}, {"chosen", 0}, {"gate", 0}});
  CAPTURE(alone);
  CAPTURE(paper);
  CHECK(alone < 1.2 * clean);
  CHECK(paper > 1.5 * alone);
}

}  // namespace braid::test_double_shrinkage
