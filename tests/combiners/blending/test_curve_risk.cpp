// SPDX-License-Identifier: Apache-2.0
// What convergence curves know about the denoised image: risks that noise hides, noise that both images share, and
// slopes that few points tell badly.
#include <cmath>
#include <limits>
#include <map>

#include <doctest/doctest.h>

#include "combiners/curves/curve_weight.h"
#include "combiners/pipeline/registry.h"
#include "combiners/statistics/sure_map.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_curve_risk {

using namespace test;

namespace {

MethodResult run(const MethodInputs& in, const std::map<std::string, double>& options) {
  MethodInputs copy = in;
  for (const auto& [name, value] : options) copy.options.set("curves-" + name, value);
  return make_curves()->run(copy);
}

// own * n + (1 - own) * truth, and off by `bias` in the 15x15 pixels from (8, 8) on.
Rgb<float> imageOf(const Rgb<float>& n, const Rgb<float>& truth, float own, float bias) {
  Rgb<float> out = truth;
  for (size_t c = 0; c < 3; ++c) {
    for (size_t i = 0; i < out.size(); ++i) out[c][i] = own * n[c][i] + (1 - own) * truth[c][i];
    for (int y = 8; y < 23; ++y)
      for (int x = 8; x < 23; ++x) out[c].at(x, y) += bias;
  }
  return out;
}

// A denoiser that keeps a share of the noise: the squared error is own² v, the covariance own v.
struct Keeping {
  Case c;
  Estimate denoised;
  MethodInputs in;

  Keeping(const CaseOptions& o, float own, float bias = 0) : c(makeCase(o)) {
    denoised = c.find("wide");
    denoised.mean = imageOf(c.pt().mean, c.truth, own, bias);
    in = inputsOf(c, "wide");
    in.biased = &denoised;
    in.redenoise = [this, own, bias](const Rgb<float>& n) { return imageOf(n, c.truth, own, bias); };
  }
};

double meanShare(const MethodResult& r, int from, int to) {
  double sum = 0;
  for (int y = from; y < to; ++y)
    for (int x = from; x < to; ++x) sum += static_cast<double>(r.aovs[0].plane.at(x, y));
  return sum / ((to - from) * (to - from));
}

}  // namespace

TEST_CASE("The independent error has the weights of the best mean of correlated images") {
  for (const double v : {1e-6, 0.2, 1.0, 30.0})
    for (const double m : {1e-6, 0.3, 1.0})
      for (const double correlation : {-0.9, 0.0, 0.4}) {
        const double q = correlation * std::sqrt(v * m);
        if (q >= std::min(v, m)) continue;
        const double e = independentError(v, m, q);
        CHECK(v / (v + e) == doctest::Approx((v - q) / (v + m - 2 * q)));
        // Of four times the passes, only a quarter is that of which d was made: v / 4, q / 4, and still W passes.
        const double later = independentError(v, m, q, 0.25);
        CHECK(v / 4 / (v / 4 + later) == doctest::Approx((v - q) / 4 / (v / 4 + m - q / 2)));
      }
  CHECK(independentError(1, 0.25, 0.4) == 0);
  CHECK(independentError(0.25, 1, 0.4) == std::numeric_limits<double>::infinity());
  CHECK(independentError(1, 0.25, 0) == 0.25);
}

TEST_CASE("The independent error is a number for whatever the maps hold") {
  const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  for (const double v : {0.0, 1e-45, 1.0, 1e38, inf})
    for (const double m : {0.0, 1e-45, 1.0, 1e38, inf})
      for (const double q : {-inf, -1.0, 0.0, 1e-45, 1.0, inf, nan})
        for (const double share : {0.0, 1e-9, 1.0}) CHECK(independentError(v, m, q, share) >= 0);
}

TEST_CASE("The prior pulls slopes towards that of Monte Carlo, and nothing else") {
  std::vector<CurvePoint> flat, theory;
  for (const double passes : {4.0, 8.0, 16.0, 32.0}) {
    flat.push_back({passes, std::pow(passes, -0.5)});
    theory.push_back({passes, 3 / passes});
  }
  const double own = 5 * std::log(2.0) * std::log(2.0);
  const auto fit = fitCurve(flat, 4, 8);
  CHECK(fit->slope == doctest::Approx((-0.5 * own - 8) / (own + 8)));
  CHECK(fit->passesAt(std::pow(std::sqrt(8.0 * 16), -0.5)) == doctest::Approx(std::sqrt(8.0 * 16)));
  CHECK(fitCurve(theory, 4, 8)->slope == doctest::Approx(-1));
  CHECK(fitCurve(flat, 4, 0)->slope == doctest::Approx(-0.5));
}

TEST_CASE("The covariance of both errors is half of the divergence times the variance") {
  CaseOptions o;
  o.width = 128;
  o.height = 96;
  const Keeping k(o, 0.3f);
  const Estimate& n = k.c.pt();
  const SureMaps maps = sureMaps(n.mean, k.denoised.mean, n.variance, 1, 0.1, k.in.redenoise);
  double sum = 0, square = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < n.mean.size(); ++i) {
      const double excess = static_cast<double>(maps.covariance[c][i]) - 0.3 * static_cast<double>(n.variance[c][i]);
      sum += excess;
      square += excess * excess;
    }
  CHECK(square > 0);
  // Four standard errors: a false alarm in 16000.
  CHECK(std::fabs(sum) < 4 * std::sqrt(square));
}

TEST_CASE("A risk that noise hides is pooled, and one that shows is not") {
  CaseOptions o;
  o.width = o.height = 80;
  o.samples = 64;
  o.constant = 1;
  const Keeping good(o, 0.05f), wrong(o, 0.05f, 1.5f);
  const std::map<std::string, double> alone = {{"pool", 0}, {"covariance", 0}}, pooled = {{"covariance", 0}};
  const auto errorOf = [&](const Keeping& k, const std::map<std::string, double>& options) {
    return meanSquaredError(run(k.in, options).image.mean, k.c.truth);
  };
  const double apart = errorOf(good, alone), together = errorOf(good, pooled);
  MESSAGE("squared error ", apart, " and pooled ", together, " of ", meanSquaredError(good.c.pt().mean, good.c.truth));
  CHECK(together < 0.75 * apart);
  // The bias of 6 deviations over a small square is told from the risk around it.
  const MethodResult r = run(wrong.in, pooled);
  CHECK(meanShare(r, 11, 20) < 0.1);
  CHECK(meanShare(r, 40, 70) > 0.9);
}

TEST_CASE("Noise that both images share does not count against the denoised one") {
  CaseOptions o;
  o.width = o.height = 80;
  o.samples = 64;
  o.constant = 1;
  // The best mean is the denoised image alone; by its error alone it would have 1 / (1 + 0.7²) of the weight.
  const Keeping k(o, 0.7f);
  const MethodResult without = run(k.in, {{"covariance", 0}}), with = run(k.in, {});
  CHECK(meanShare(without, 0, 80) < 0.75);
  CHECK(meanShare(with, 0, 80) > 0.9);
  CHECK(meanSquaredError(with.image.mean, k.c.truth) < 0.95 * meanSquaredError(without.image.mean, k.c.truth));
}

}  // namespace braid::test_curve_risk
