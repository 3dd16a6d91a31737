// SPDX-License-Identifier: Apache-2.0
// The regression that makes Y*, the image towards which James-Stein shrinks.
#include <doctest/doctest.h>

#include "combiners/pipeline/registry.h"
#include "combiners/shrinkage/optimised_bias.h"
#include "combiners/shrinkage/shrinkage.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_james_stein_fit {

using namespace test;

TEST_CASE("Y* is exact where X is affine in Y and the features, up to the ridge") {
  CaseOptions o;
  o.noise = o.photonNoise = o.featureNoise = 0;
  Case c = makeCase(o);
  Estimate x = c.pt();
  const Features& f = *c.estimates.features;
  for (size_t ch = 0; ch < 3; ++ch)
    for (size_t i = 0; i < x.mean.size(); ++i)
      x.mean[ch][i] = x.half[0][ch][i] = x.half[1][ch][i] =
          1 + 0.5f * c.sppm().mean[0][i] + 0.3f * f.normal.mean[2][i] + 0.2f * f.depth.mean[i];
  RegressionSettings s;
  s.ridge = 1e-4;
  s.fallbackWeight = 0;
  const OptimisedBias fit = optimisedBias(x, c.sppm(), &f, s);
  const double variance = meanSquaredError(x.mean, Rgb<float>(o.width, o.height, 1.5f));
  CHECK(meanSquaredError(fit.mean(), x.mean) < 1e-6 * variance);
  s.ridge = 0.1;
  const double ridged = meanSquaredError(optimisedBias(x, c.sppm(), &f, s).mean(), x.mean);
  CHECK(ridged < 1e-2 * variance);
  CHECK(ridged > 0);
}

TEST_CASE("Crossed fits take targets from one half and everything else from the other; own fits see one half only") {
  CaseOptions o;
  o.width = 40;
  o.height = 30;
  Case c = makeCase(o);
  const OptimisedBias before = optimisedBias(c.pt(), c.sppm(), &*c.estimates.features, RegressionSettings());
  Estimate x = c.pt();
  for (size_t ch = 0; ch < 3; ++ch) x.half[0][ch].at(11, 12) += 3;
  const OptimisedBias after = optimisedBias(x, c.sppm(), &*c.estimates.features, RegressionSettings());
  CHECK(!identical(before.crossed[0], after.crossed[0]));
  CHECK(identical(before.crossed[1], after.crossed[1]));
  CHECK(!identical(before.own[0], after.own[0]));
  CHECK(identical(before.own[1], after.own[1]));
  Features f = *c.estimates.features;
  f.normal.half[0][0].at(11, 12) += 0.5f;
  const OptimisedBias moved = optimisedBias(c.pt(), c.sppm(), &f, RegressionSettings());
  CHECK(identical(before.crossed[0], moved.crossed[0]));  // X^A on f^B
  CHECK(!identical(before.crossed[1], moved.crossed[1]));
  CHECK(identical(before.own[1], moved.own[1]));
  double kappa = 0;  // mean over pixels and channels of (Y^A - Y^B)² / 2
  for (size_t ch = 0; ch < 3; ++ch)
    for (size_t i = 0; i < x.mean.size(); ++i)
      kappa += sqr(static_cast<double>(c.sppm().half[0][ch][i]) - static_cast<double>(c.sppm().half[1][ch][i])) / 2;
  CHECK(before.bandwidth == doctest::Approx(kappa / (3.0 * 40 * 30)));
}

TEST_CASE("The fit is taken where it helps: nearly as good as the better of with and without") {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.samples = 64;
  Case c = makeCase(o);
  Estimate exact = c.find("wide"), dark = c.find("wide");
  exact.mean = exact.half[0] = exact.half[1] = c.truth;
  dark.mean = c.truth;
  for (size_t ch = 0; ch < 3; ++ch)
    for (float& v : dark.mean[ch].data) v = 0.6f * v + 0.1f;
  dark.half[0] = dark.half[1] = dark.mean;
  const auto error = [&](const Estimate& y, double regression) {
    MethodInputs in = inputsOf(c);
    in.biased = &y;
    in.options.set("js-regression", regression);
    in.options.set("js-measured", 0);
    return meanSquaredError(make_js()->run(in).image.mean, c.truth);
  };
  for (const Estimate* y : std::initializer_list<const Estimate*>{&exact, &dark, &c.find("narrow"), &c.find("wide")}) {
    const double without = error(*y, 0), with = error(*y, 1), chosen = error(*y, 2);
    INFO("without ", without, " with ", with, " chosen ", chosen);
    CHECK(chosen < 1.1 * std::min(without, with) + 1e-7);
  }
  // Both happen.
  CHECK(error(exact, 0) < 0.5 * error(exact, 1));
  CHECK(error(dark, 1) < 0.5 * error(dark, 0));
}

TEST_CASE("Whitened, a noisy lamp does not hide what Y gets wrong beside it") {
  // Quiet pixels that Y gets wrong by 30 of their deviations, about one pixel with 10⁹ times their variance.
  const int size = 31;
  Rgb<float> x(size, size, 1.0f), y(size, size, 1.3f), variance(size, size, 1e-4f);
  const size_t lamp = x[0].index(15, 15);
  for (size_t c = 0; c < 3; ++c) {
    x[c][lamp] = 500;
    y[c][lamp] = 100;
    variance[c][lamp] = 1e5f;
  }
  JamesSteinSettings box, whitened;
  whitened.filter = VarianceFilter::Whitened;
  const size_t beside = x[0].index(18, 13);
  CHECK(jamesStein(x, variance, y, box).image[0][beside] > 1.15f);
  CHECK(jamesStein(x, variance, y, whitened).image[0][beside] < 1.02f);
  // Equal variances: the units cancel.
  for (size_t c = 0; c < 3; ++c) x[c][lamp] = 1, y[c][lamp] = 1.3f, variance[c][lamp] = 1e-4f;
  for (const size_t i : {beside, lamp})
    CHECK(jamesStein(x, variance, y, whitened).factor[1][i] ==
          doctest::Approx(jamesStein(x, variance, y, box).factor[1][i]).epsilon(1e-4));
}

}  // namespace braid::test_james_stein_fit
