// SPDX-License-Identifier: Apache-2.0
// Blending by convergence curves: the fit, the closed form of the fallback, limits and degenerate pixels, and the
// method on synthetic renders with denoisers of known risk.
#include <cmath>
#include <limits>

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

#include <doctest/doctest.h>

#include "combiners/curves/curve_weight.h"
#include "combiners/pipeline/registry.h"
#include "combiners/statistics/sure_map.h"
#include "renderer/core/error.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_curves {

using namespace test;

namespace {

const WeightLimits kNoLimits{1e30, 1e30};

std::vector<CurvePoint> law(double constant, double slope, std::initializer_list<double> passes) {
  std::vector<CurvePoint> points;
  for (const double p : passes) points.push_back({p, constant * std::pow(p, slope)});
  return points;
}

MethodResult run(const MethodInputs& in, const std::map<std::string, double>& options = {}) {
  MethodInputs copy = in;
  for (const auto& [name, value] : options) copy.options.set("curves-" + name, value);
  return make_curves()->run(copy);
}

double meanOf(const Plane<float>& p) {
  double sum = 0;
  for (const float v : p.data) sum += static_cast<double>(v);
  return sum / static_cast<double>(p.size());
}

}  // namespace

TEST_CASE("Variance C / I and a known risk: W = I v / SURE") {
  for (const size_t points : {size_t(2), size_t(4)})
    for (const double risk : {0.5, 0.02, 1e-4}) {
      const auto history = law(3, -1, {2, 4, 8, 16, 32});
      const CurvePoint now = history.back();
      const double w = denoisedWeight(history, now, risk, 0, {-2, 0, points}, kNoLimits);
      CHECK(w == doctest::Approx(32 * now.variance / risk).epsilon(1e-9));
    }
}

TEST_CASE("The curve is a line through logarithms, from the newest point back to the first that is not larger") {
  const auto fit = fitCurve(law(5, -0.7, {4, 8, 16, 32}), 4);
  REQUIRE(fit);
  CHECK(fit->slope == doctest::Approx(-0.7));
  CHECK(fit->passesAt(5 * std::pow(20, -0.7)) == doctest::Approx(20));
  // The published code fits log(log v + 100) instead: that is not a line for a power law.
  auto history = law(1, -1, {2, 4, 8, 16});
  history[1].variance = 0.01;  // lower than what came later: it and what is older are left out
  CHECK(fitCurve(history, 4)->slope == doctest::Approx(-1));
  history[2].variance = 0.001;
  CHECK_FALSE(fitCurve(history, 4));
  history = law(1, -1, {2, 4, 8, 16});
  history[2].variance = 0;
  CHECK_FALSE(fitCurve(history, 4));
  CHECK_FALSE(fitCurve({}, 4));
  CHECK_FALSE(fitCurve(law(1, -1, {8}), 4));
  CHECK_FALSE(fitCurve(law(1, -1, {4, 8}), 1));
  CHECK_FALSE(fitCurve(std::vector<CurvePoint>{{8, 2}, {8, 1}}, 2));
  // One pass has the logarithm 0, which the published code divides by.
  CHECK(fitCurve(law(1, -1, {1, 2}), 2)->slope == doctest::Approx(-1));
  CHECK(fitCurve(law(1, -5, {8, 16}), 2)->slope == -2);
  CHECK(fitCurve(law(1, -0.01, {8, 16}), 2)->slope == -0.25);
  // A clamped line still passes through the centre of its points.
  const auto steep = law(1, -5, {8, 16});
  CHECK(fitCurve(steep, 2)->passesAt(std::sqrt(steep[0].variance * steep[1].variance)) ==
        doctest::Approx(std::sqrt(8.0 * 16)));
}

TEST_CASE("The second point of the paper is slope -2 in disguise, and the fallback is its closed form") {
  // V_{N-K} = V_K / (N/K - 1)²: the line through (K, V_K) and (N - K, V_{N-K}).
  for (const double n : {1e3, 1e6, 1e20})
    for (const double k : {4.0, 100.0}) {
      const double slope = std::log(1 / ((n / k - 1) * (n / k - 1))) / std::log((n - k) / k);
      CHECK(slope == doctest::Approx(-2).epsilon(1e-9));
    }
  const CurvePoint now{64, 0.25};
  const std::vector<CurvePoint> alone = {now};
  CHECK(denoisedWeight(alone, now, 0.01, 0, {-2, 0, 4}, kNoLimits) == doctest::Approx(64 * std::sqrt(0.25 / 0.01)));
  CHECK(denoisedWeight(alone, now, 0.01, 0, {-1, 0, 4}, kNoLimits) == doctest::Approx(64 * 0.25 / 0.01));
  // Half as aggressive in logarithms.
  CHECK(denoisedWeight(alone, now, 0.25, 0, {-2, 0, 4}, kNoLimits) == doctest::Approx(64));
}

TEST_CASE("W is finite and within its limits whatever the pixel holds") {
  const CurvePoint now{64, 0.25};
  const std::vector<CurvePoint> alone = {now};
  const WeightLimits limits;
  CHECK(denoisedWeight(alone, now, 0, 0, {-2, 0, 4}, limits) == 64 * 64);
  CHECK(denoisedWeight(alone, now, 1e-30, 0, {-1, 0, 4}, limits) == 64 * 64);
  const CurvePoint late{100000, 0.25};
  CHECK(denoisedWeight({&late, 1}, late, 0, 1e-9, {-1, 0, 4}, limits) == 65536);
  const double extremes[] = {0, 1e-45, 1e-38, 1e-12, 1, 1e18, 1e300, std::numeric_limits<double>::infinity()};
#if defined(__SSE__)
  // As in the threads of a render, which flush subnormals to 0: the published code came to log(0) there.
  const unsigned mode = _mm_getcsr();
  _mm_setcsr(mode | 0x8040);
#endif
  for (const double v : extremes)
    for (const double risk : extremes)
      for (const double epsilon : {0.0, 1e-30, 1e-6})
        for (const double passes : {0.0, 1.0, 16.0, 1e12}) {
          const std::vector<CurvePoint> history = {{passes / 2, 2 * v}, {passes, v}};
          const double w = denoisedWeight(history, {passes, v}, risk, epsilon, {-2, 0, 4}, limits);
          CHECK(std::isfinite(w));
          CHECK(w >= 0);
          CHECK(w <= 65536);
        }
#if defined(__SSE__)
  _mm_setcsr(mode);
#endif
  // A pixel without variance, black or not, keeps its noisy value, which it has for certain.
  CHECK(denoisedWeight({}, {64, 0}, 0, 1e-6, {-2, 0, 4}, limits) == 0);
  CHECK(denoisedWeight({}, {64, 0}, 0, 0, {-2, 0, 4}, limits) == 0);
}

TEST_CASE("Everywhere black stays black, and a lamp without noise keeps its value") {
  CaseOptions o;
  o.light = 0;
  const Case black = makeCase(o);
  CHECK(meanSquaredError(run(inputsOf(black, "wide")).image.mean, black.truth) == 0);
  CaseOptions still;
  still.noise = 0;
  const Case lamp = makeCase(still);
  CHECK(meanSquaredError(run(inputsOf(lamp, "wide")).image.mean, lamp.truth) < 1e-9);
}

TEST_CASE("A denoiser without error takes the pixel, one with a large error leaves it, and the error map knows") {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.samples = 64;
  const Case c = makeCase(o);
  Estimate exact = c.find("wide"), wrong = exact;
  exact.mean = exact.half[0] = exact.half[1] = c.truth;
  wrong.mean = wrong.half[0] = wrong.half[1] = c.truth;
  for (size_t k = 0; k < 3; ++k)
    for (float& v : wrong.mean[k].data) v += 5;
  MethodInputs in = inputsOf(c, "wide");
  for (const Estimate* d : {&exact, &wrong}) {
    in.biased = d;
    in.redenoise = [d](const Rgb<float>&) { return d->mean; };  // does not look at its input: no divergence
    const MethodResult r = run(in);
    const double error = meanSquaredError(r.image.mean, c.truth), noisy = meanSquaredError(c.pt().mean, c.truth);
    MESSAGE(std::string(d == &exact ? "exact" : "wrong"), ": error ", error, " of ", noisy,
            ", share of the denoised image ", meanOf(r.aovs[0].plane), ", estimated error ", meanOf(r.error));
    if (d == &exact) CHECK(error < 0.2 * noisy);
    if (d == &wrong) CHECK(error < 1.2 * noisy);
  }
}

TEST_CASE("Better than the noisy and the denoised image and easy blending, with a calibrated error") {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.samples = 128;
  double sums[5] = {0, 0, 0, 0, 0};
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    o.seed = seed;
    const Case c = makeCase(o);
    const MethodInputs in = inputsOf(c, "wide");
    const MethodResult r = run(in);
    sums[0] += meanSquaredError(r.image.mean, c.truth);
    sums[1] += meanSquaredError(c.pt().mean, c.truth);
    sums[2] += meanSquaredError(c.find("wide").mean, c.truth);
    sums[3] += meanSquaredError(make_easy()->run(in).image.mean, c.truth);
    sums[4] += meanOf(r.error);
    CHECK(r.remarks[1].integer == 4);
  }
  MESSAGE("curves ", sums[0], ", noisy ", sums[1], ", denoised ", sums[2], ", easy ", sums[3], ", estimated ", sums[4]);
  CHECK(sums[0] < sums[1]);
  CHECK(sums[0] < sums[2]);
  CHECK(sums[0] < sums[3]);
  CHECK(sums[4] > 0.5 * sums[0]);
  CHECK(sums[4] < 2 * sums[0]);
}

TEST_CASE("The denoised image fades as samples are added") {
  double share[2];
  for (int k = 0; k < 2; ++k) {
    CaseOptions o;
    o.width = 48;
    o.height = 36;
    o.samples = k == 0 ? 32 : 2048;
    const Case c = makeCase(o);
    const MethodResult r = run(inputsOf(c, "wide"));
    share[k] = meanOf(r.aovs[0].plane);
    if (k == 1) CHECK(meanSquaredError(r.image.mean, c.truth) < 1.1 * meanSquaredError(c.pt().mean, c.truth));
  }
  MESSAGE("share of the denoised image at 32 and 2048 samples: ", share[0], ", ", share[1]);
  CHECK(share[1] < 0.5 * share[0]);
}

// A lamp whose noise is far above everything else, in the dark, where the denoised image is wrong by ten deviations.
TEST_CASE("A lamp does not hide what is wrong with the denoised image in the dark around it") {
  constexpr int kSize = 21, kCentre = kSize / 2;
  Estimate noisy, wrong;
  noisy.name = "pt";
  noisy.passes = 64;
  noisy.mean = Rgb<float>(kSize, kSize, 0.1f);
  noisy.variance = Rgb<float>(kSize, kSize, 1e-4f);
  wrong.mean = Rgb<float>(kSize, kSize, 0.2f);
  for (size_t c = 0; c < 3; ++c) {
    noisy.mean[c].at(kCentre, kCentre) = wrong.mean[c].at(kCentre, kCentre) = 100;
    noisy.variance[c].at(kCentre, kCentre) = 100;
  }
  MethodInputs in;
  in.unbiased = &noisy;
  in.biased = &wrong;
  in.redenoise = [&](const Rgb<float>&) { return wrong.mean; };
  const auto shareBeside = [&](double relative) {
    return run(in, {{"relative", relative}, {"gate", 0}}).aovs[0].plane.at(kCentre - 2, kCentre + 1);
  };
  CHECK(shareBeside(0) > 0.9f);
  CHECK(shareBeside(1) < 0.1f);
}

TEST_CASE("Halves take the weights of the image, few passes take the fallback, and options act") {
  const Case c = makeCase();
  const MethodInputs in = inputsOf(c, "wide");
  const MethodResult r = run(in);
  const Rgb<float>& m = r.image.mean;
  for (size_t i = 0; i < m.size(); ++i)
    CHECK(std::fabs(m[2][i] - 0.5f * (r.image.half[0][2][i] + r.image.half[1][2][i])) < 1e-5f * (1 + m[2][i]));
  MethodInputs bare = in;
  bare.history = nullptr;
  CHECK(run(bare).remarks[1].integer == 1);
  CHECK(identical(run(bare).image.mean, run(in, {{"points", 1}}).image.mean));
  // With slope -1 it is the mean by inverse squared errors, at least as much of the denoised image where that is
  // better.
  const auto shareWith = [&](double slope) {
    return meanOf(run(bare, {{"relative", 0}, {"fallback-slope", slope}}).aovs[0].plane);
  };
  CHECK(shareWith(-1) > shareWith(-2));
  CHECK_FALSE(identical(run(in, {{"relative", 0}}).image.mean, m));
  CHECK(identical(run(in, {{"most", 0}}).image.mean, c.pt().mean));
  CaseOptions few;
  few.samples = 8;
  const Case f = makeCase(few);
  CHECK(run(inputsOf(f, "wide")).remarks[1].integer == 1);
  MethodInputs cannot = in;
  cannot.redenoise = nullptr;
  CHECK_THROWS_AS(run(cannot), Error);
}

TEST_CASE("The risk estimate probes with the deviation of the pixel, so it scales with the noise") {
  // Eqs. 12 and 13 read literally probe with unit noise at any noise level. For f(n) = n / 2, the risk of each pixel is
  // v / 4 + t² / 4; the average over pixels of the estimate must match at every noise level.
  for (const double noise : {0.01, 0.1, 1.0}) {
    CaseOptions o;
    o.width = 128;
    o.height = 96;
    o.noise = noise;
    const Case c = makeCase(o);
    const auto halve = [](const Rgb<float>& in) {
      Rgb<float> out = in;
      for (size_t k = 0; k < 3; ++k)
        for (float& v : out[k].data) v *= 0.5f;
      return out;
    };
    const Rgb<float> d = halve(c.pt().mean);
    const Rgb<float> sure = sureMaps(c.pt().mean, d, c.pt().variance, 1, 0.1, halve).risk;
    double estimated = 0, sum = 0, square = 0;
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < d.size(); ++i) {
        const double e = sqr(static_cast<double>(d[k][i]) - static_cast<double>(c.truth[k][i]));
        estimated += static_cast<double>(sure[k][i]);
        sum += e;
        square += sqr(static_cast<double>(sure[k][i]) - e);
      }
    // Four standard errors: a false alarm in 16000.
    CHECK(std::fabs(estimated - sum) < 4 * std::sqrt(square));
  }
}

TEST_CASE("A lone firefly is replaced by the denoised image, unless it contradicts that") {
  CaseOptions o;
  o.samples = 64;
  Case c = makeCase(o);
  Estimate& n = c.estimates.estimates[0];
  const int x = 20, y = 14;
  for (size_t ch = 0; ch < 3; ++ch) {
    n.mean[ch].at(x, y) = 50;
    n.variance[ch].at(x, y) = 50 * 50;
  }
  MethodInputs in = inputsOf(c, "narrow");
  in.redenoise = [](const Rgb<float>& image) { return image; };
  const float denoised = in.biased->mean[0].at(x, y);
  CHECK(run(in).image.mean[0].at(x, y) == denoised);
  CHECK(run(in, {{"gate", 0}}).image.mean[0].at(x, y) > denoised + 0.1f);
  for (size_t ch = 0; ch < 3; ++ch) n.variance[ch].at(x, y) = 10 * 10;  // five deviations: not chance
  CHECK(run(in).image.mean[0].at(x, y) > denoised + 0.1f);
}

}  // namespace braid::test_curves
