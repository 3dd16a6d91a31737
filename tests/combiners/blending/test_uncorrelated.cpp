// SPDX-License-Identifier: Apache-2.0
// Uncorrelated weighting and its two baselines: the weights themselves by impulses, the invariances that make them
// unbiased, edges under perfect correlation, and bias and noise over replicated renders.
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include "combiners/pipeline/registry.h"
#include "combiners/pixels/mirror.h"
#include "combiners/uncorrelated/uncorrelated_filter.h"
#include "combiners/uncorrelated/uncorrelated_groups.h"
#include "combiners/uncorrelated/uncorrelated_noise.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_uncorrelated {

using namespace test;

namespace {

constexpr int kWidth = 40, kHeight = 34;

Rgb<float> randomImage(unsigned seed, double deviation = 1, double mean = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss(mean, deviation);
  Rgb<float> image(kWidth, kHeight);
  for (size_t c = 0; c < 3; ++c)
    for (float& v : image[c].data) v = static_cast<float>(gauss(random));
  return image;
}

template <class Map>
Rgb<float> mapped(const Rgb<float>& a, const Map& map) {
  Rgb<float> out = a;
  for (size_t c = 0; c < 3; ++c)
    for (float& v : out[c].data) v = map(v);
  return out;
}

float largestDifference(const Rgb<float>& a, const Rgb<float>& b) {
  float most = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < a.size(); ++i) most = std::max(most, std::fabs(a[c][i] - b[c][i]));
  return most;
}

// What y_i contributes to out_c, by an impulse in y: k_i, or k_c for the centre.
float responseAt(const UncorrelatedInputs& in, double gamma, int cx, int cy, int ix, int iy) {
  Rgb<float> y = mapped(*in.independent, [](float) { return 0.0f; });
  const Rgb<float> zero = y;
  y[0].at(ix, iy) = 1;
  const UncorrelatedInputs probe{&y, &zero, in.first, in.second, in.samples};
  return uncorrelatedFiltered(probe, gamma)[0].at(cx, cy);
}

// A scene with an edge: the truth, and estimates of it whose samples are skewed.
Rgb<float> edgeScene() {
  Rgb<float> f(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x)
      f.set(f[0].index(x, y), Vec3(x + y / 3 < 25 ? 0.2f : 1.5f, 0.5f, 0.01f * static_cast<float>(x)));
  return f;
}

}  // namespace

TEST_CASE("gamma = 0 gives every neighbour 1/224 and the centre nothing, which is not the uniform baseline") {
  const Rgb<float> a = randomImage(1), b = randomImage(2);
  const UncorrelatedInputs in{&a, &a, &a, &b, 4};
  CHECK(responseAt(in, 0, 20, 17, 20, 17) == doctest::Approx(0).epsilon(1e-6));
  for (const auto& [dx, dy] : {std::pair{1, 0}, {-7, 7}, {7, -7}, {0, -3}})
    CHECK(responseAt(in, 0, 20, 17, 20 + dx, 17 + dy) == doctest::Approx(1.0 / 224));
  CHECK(responseAt(in, 0, 20, 17, 28, 17) == 0);
  Rgb<float> impulse(kWidth, kHeight);
  const Rgb<float> zero = impulse;
  impulse[0].at(20, 17) = 1;
  const Rgb<float> uniform = uniformlyFiltered(impulse, zero);
  for (const auto& [x, y] : {std::pair{20, 17}, {21, 17}, {13, 10}, {27, 24}})
    CHECK(uniform[0].at(x, y) == doctest::Approx(1.0 / 225));
  CHECK(uniform[0].at(28, 17) == 0);
}

TEST_CASE("Weights are the formula, also at mirrored borders") {
  const Rgb<float> y = randomImage(3), z = randomImage(4), z1 = randomImage(5, 0.2), z2 = randomImage(6, 0.2);
  const double gamma = 0.5, n = 6;
  const Rgb<float> out = uncorrelatedFiltered({&y, &z, &z1, &z2, n}, gamma);
  for (const auto& [px, py] : {std::pair{20, 17}, {0, 0}, {38, 33}})
    for (size_t c = 0; c < 3; ++c) {
      const auto at = [&](const Rgb<float>& image, int qx, int qy) {
        return static_cast<double>(image[c].at(mirrorIndex(qx, kWidth), mirrorIndex(qy, kHeight)));
      };
      double sum = at(y, px, py);
      for (int qy = py - 7; qy <= py + 7; ++qy)
        for (int qx = px - 7; qx <= px + 7; ++qx) {
          if (qx == px && qy == py) continue;
          const double d1 = at(z1, px, py) - at(z1, qx, qy), d2 = at(z2, px, py) - at(z2, qx, qy);
          sum += std::exp(-gamma * n * (d1 - d2) * (d1 - d2)) / 224 *
                 (at(z, px, py) - at(z, qx, qy) - at(y, px, py) + at(y, qx, qy));
        }
      CHECK(static_cast<double>(out[c].at(px, py)) == doctest::Approx(sum).epsilon(1e-5));
    }
}

TEST_CASE("Weights do not change with a common shift of an average, with its sign, or with swapping both") {
  const Rgb<float> y = randomImage(7), z = randomImage(8), z1 = randomImage(9, 0.3), z2 = randomImage(10, 0.3);
  const Rgb<float> out = uncorrelatedFiltered({&y, &z, &z1, &z2, 4}, 0.5);
  const Rgb<float> shifted = mapped(z1, [](float v) { return v + 3; });
  const Rgb<float> minus1 = mapped(z1, [](float v) { return -v; }), minus2 = mapped(z2, [](float v) { return -v; });
  CHECK(largestDifference(uncorrelatedFiltered({&y, &z, &shifted, &z2, 4}, 0.5), out) < 1e-5f);
  CHECK(largestDifference(uncorrelatedFiltered({&y, &z, &minus1, &minus2, 4}, 0.5), out) == 0);
  CHECK(largestDifference(uncorrelatedFiltered({&y, &z, &z2, &z1, 4}, 0.5), out) == 0);
  // Sanity: they do change with the differences.
  CHECK(largestDifference(uncorrelatedFiltered({&y, &z, &z1, &minus2, 4}, 0.5), out) > 1e-3f);
}

TEST_CASE("Perfect correlation keeps edges: the result is the truth plus the mean of its neighbours' noise") {
  const Rgb<float> f = edgeScene(), noise = randomImage(11, 0.5, 0);
  Rgb<float> y = f;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < y.size(); ++i) y[c][i] += noise[c][i];
  const auto offset = [&f](float by) { return mapped(f, [by](float v) { return v + by; }); };
  const Rgb<float> z = offset(0.25f), z1 = offset(-0.5f), z2 = offset(1);
  const Rgb<float> out = uncorrelatedFiltered({&y, &z, &z1, &z2, 4}, 2.5);
  for (size_t c = 0; c < 3; ++c) {
    const Plane<double> mean = mirrorBoxMean(noise[c], 7);
    for (size_t i = 0; i < y.size(); ++i) {
      const double neighbours = (225 * mean[i] - static_cast<double>(noise[c][i])) / 224;
      CHECK(std::fabs(static_cast<double>(out[c][i] - f[c][i]) - neighbours) < 1e-4);
    }
  }
}

TEST_CASE("The scores are the variance of what the candidates make, and the lowest finite one wins") {
  Case c = makeCase();
  const Estimate &y = c.pt(), &z = c.crn();
  const UncorrelatedInputs groups[2] = {uncorrelatedGroup(y, z, 0, 0, 0), uncorrelatedGroup(y, z, 1, 1, 1)};
  CHECK(groups[0].samples == 8);
  const std::array<double, 10> scores = uncorrelatedScores(groups, y.mean, 1);
  for (size_t k = 0; k < scores.size(); ++k) {
    const auto gamma = static_cast<double>(kUncorrelatedGammas[k]);
    const Rgb<float> a = uncorrelatedFiltered(groups[0], gamma), b = uncorrelatedFiltered(groups[1], gamma);
    double sum = 0;
    for (size_t ch = 0; ch < 3; ++ch) {
      const Plane<double> level = mirrorBoxMean(y.mean[ch], 7);
      for (size_t i = 0; i < a.size(); ++i)
        sum += sqr(static_cast<double>(a[ch][i]) - static_cast<double>(b[ch][i])) / (sqr(level[i]) + 0.01);
    }
    CHECK(scores[k] == doctest::Approx(sum / static_cast<double>(3 * a.size())).epsilon(1e-3));
  }
  // A quarter of the rows says nearly the same.
  const std::array<double, 10> fewer = uncorrelatedScores(groups, y.mean, 4);
  for (size_t k = 0; k < scores.size(); ++k) CHECK(fewer[k] == doctest::Approx(scores[k]).epsilon(0.25));

  std::array<double, 10> made;
  made.fill(std::nan(""));
  CHECK(bestGamma(made) == doctest::Approx(0.01));
  made[3] = 2;
  made[7] = 1;
  CHECK(bestGamma(made) == doctest::Approx(1.5));
  made.fill(0);
  CHECK(bestGamma(made) == doctest::Approx(0.01));
}

TEST_CASE("Less error than uniform weights where both images are as noisy") {
  constexpr int kRuns = 8;
  double weighted = 0, uniform = 0;
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.samples = 64;
  o.noise = 1;
  for (int run = 0; run < kRuns; ++run) {
    o.seed = 1 + static_cast<uint64_t>(run);
    const Case c = makeCase(o);
    weighted += meanSquaredError(make_uncorrelated()->run(inputsOf(c)).image.mean, c.truth) / kRuns;
    uniform += meanSquaredError(make_uncorrelated_uniform()->run(inputsOf(c)).image.mean, c.truth) / kRuns;
  }
  MESSAGE("error over that of uniform weights: ", weighted / uniform);
  CHECK(weighted < 0.9 * uniform);
}

TEST_CASE("The methods: less noise than their input, halves, error, and a gamma of the list") {
  constexpr int kRuns = 8;
  double noisy = 0, errors[3] = {0, 0, 0}, estimated[3] = {0, 0, 0};
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.samples = 64;
  for (int run = 0; run < kRuns; ++run) {
    o.seed = 1 + static_cast<uint64_t>(run);
    const Case c = makeCase(o);
    noisy += meanSquaredError(c.pt().mean, c.truth) / kRuns;
    size_t k = 0;
    for (const auto& m : {make_uncorrelated(), make_uncorrelated_cross(), make_uncorrelated_uniform()}) {
      const MethodResult r = m->run(inputsOf(c));
      CAPTURE(std::string(m->name()));
      errors[k] += meanSquaredError(r.image.mean, c.truth) / kRuns;
      for (const float e : r.error.data)
        estimated[k] += static_cast<double>(e) / static_cast<double>(r.error.size()) / kRuns;
      ++k;
      CHECK_FALSE(r.image.half[1].empty());
      if (r.remarks.empty()) continue;
      bool listed = false;
      for (const float g : kUncorrelatedGammas) listed = listed || r.remarks[0].number == static_cast<double>(g);
      CHECK(listed);
    }
  }
  for (size_t k = 0; k < 3; ++k) {
    MESSAGE("method ", k, ": error ", errors[k], " of ", noisy, ", estimated ", estimated[k]);
    CHECK(estimated[k] > 0.5 * errors[k]);
    CHECK(estimated[k] < 2 * errors[k]);
  }
  CHECK(errors[0] < 0.5 * noisy);
  // The correlated image has half of the deviation, common to whole regions: uniform weights are the best there are.
  CHECK(errors[0] < 1.05 * errors[2]);
  const Case c = makeCase(o);
  const MethodInputs in = inputsOf(c);
  MethodInputs fixed = in;
  fixed.options.set("uncorrelated-gamma", 0.7);
  CHECK(make_uncorrelated()->run(fixed).remarks[0].number == 0.7);
}

TEST_CASE("Images from gradients are crossed: their halves meet the other halves of the samples") {
  Case c = makeCase();
  c.estimates.estimates[1].correlation = Correlation::Gradients;
  MethodInputs in = inputsOf(c);
  in.options.set("uncorrelated-gamma", 0.2);
  in.options.set("uncorrelated-measured", 0);
  const MethodResult r = make_uncorrelated()->run(in);
  const Estimate &y = c.pt(), &z = c.crn();
  const Rgb<float> levels = differenceNoiseLevels(y, z);
  const Rgb<float> a =
      uncorrelatedFiltered({&y.half[0], &z.half[1], &z.quarter[1], &z.quarter[3], 8, &levels, 224}, 0.2);
  const Rgb<float> b =
      uncorrelatedFiltered({&y.half[1], &z.half[0], &z.quarter[0], &z.quarter[2], 8, &levels, 224}, 0.2);
  for (size_t i = 0; i < a.size(); ++i) CHECK(r.image.mean[1][i] == 0.5f * (a[1][i] + b[1][i]));
  CHECK(r.image.half[0].empty());
  CHECK(r.error.empty());
}

TEST_CASE("Over replicated renders the bias is small against the deviation, and the baselines have none") {
  // 400 renders of 32 skewed samples. The squared error of the mean of a method is its squared bias plus 1/400 of its
  // variance, which is subtracted. The noise of the correlated image is common to each of three regions, so what is
  // left has some three degrees of freedom: it stays below 4/400 of the variance with a false-alarm rate of 0.2 % a
  // method.
  CaseOptions o;
  o.width = 32;
  o.height = 24;
  constexpr int kRuns = 400;
  const auto methods = {make_uncorrelated, make_uncorrelated_cross, make_uncorrelated_uniform};
  std::vector<Rgb<double>> sum(3, Rgb<double>(o.width, o.height)), square = sum;
  Rgb<float> truth;
  for (int run = 0; run < kRuns; ++run) {
    o.seed = 100 + static_cast<uint64_t>(run);
    const Case c = makeCase(o);
    truth = c.truth;
    MethodInputs in = inputsOf(c);
    in.options.set("uncorrelated-gamma", 0.5);
    in.options.set("uncorrelated-cross-gamma", 0.5);
    size_t k = 0;
    for (const auto& make : methods) {
      const Rgb<float> mean = make()->run(in).image.mean;
      for (size_t ch = 0; ch < 3; ++ch)
        for (size_t i = 0; i < mean.size(); ++i) {
          sum[k][ch][i] += static_cast<double>(mean[ch][i]);
          square[k][ch][i] += sqr(static_cast<double>(mean[ch][i]));
        }
      ++k;
    }
  }
  double bias[3] = {0, 0, 0}, variance[3] = {0, 0, 0};
  for (size_t k = 0; k < 3; ++k)
    for (size_t ch = 0; ch < 3; ++ch)
      for (size_t i = 0; i < truth.size(); ++i) {
        const double mean = sum[k][ch][i] / kRuns, v = (square[k][ch][i] / kRuns - mean * mean) * kRuns / (kRuns - 1);
        bias[k] += sqr(mean - static_cast<double>(truth[ch][i])) - v / kRuns;
        variance[k] += v;
      }
  const double relative[3] = {bias[0] / variance[2], bias[1] / variance[2], bias[2] / variance[2]};
  MESSAGE("squared bias over the variance of uniform weights: ", relative[0], ", cross ", relative[1], ", uniform ",
          relative[2], "; variance ", variance[0] / variance[2], ", cross ", variance[1] / variance[2]);
  // 10 % of the deviation.
  for (const double r : relative) CHECK(std::fabs(r) < 0.01);
}

TEST_CASE("Tiny and huge images of differences stay finite") {
  for (const auto& [w, h] : {std::pair{1, 1}, {2, 1}, {5, 3}}) {
    Rgb<float> a(w, h, 1e9f), b(w, h, -1e9f);
    a[0][0] = -1e9f;
    CHECK(allFinite(uncorrelatedFiltered({&a, &b, &a, &b, 1e6}, 2.5)));
    const Rgb<float> small(w, h, 1e-30f);
    CHECK(allFinite(uncorrelatedFiltered({&small, &small, &small, &small, 1}, 0)));
    const UncorrelatedInputs groups[2] = {{&a, &b, &a, &b, 1e6}, {&b, &a, &a, &b, 1e6}};
    for (const double s : uncorrelatedScores(groups, a, 1)) CHECK(std::isfinite(s));
  }
}

}  // namespace braid::test_uncorrelated
