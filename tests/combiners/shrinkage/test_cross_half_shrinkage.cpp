// SPDX-License-Identifier: Apache-2.0
// The factors that halves measure: their formula, and what they are for in the James-Stein combiner.
#include <algorithm>
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/shrinkage/cross_half_shrinkage.h"
#include "combiners/pipeline/registry.h"
#include "combiners/shrinkage/shrinkage.h"
#include "combiners/statistics/residual_scale.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_cross_half_shrinkage {

using namespace test;

TEST_CASE("Measured factors are the best ones for the other half, by block and channel, without gated pixels") {
  const Case c = makeCase();
  const Estimate &x = c.pt(), &y = c.find("narrow");
  Plane<float> gate(x.mean.width(), x.mean.height());
  gate.at(12, 9) = 1;
  const auto factors = crossHalfShrinkage(x, y.half, gate, 2);
  for (const int centre : {10, 20})
    for (size_t ch = 0; ch < 3; ++ch) {
      // The error is a parabola in f: its minimum from three values.
      const Plane<double> unit = residualScale(x.mean[ch], y.mean[ch], usualVariance(x.variance[ch]));
      const auto error = [&](double f) {
        double sum = 0;
        for (int v = 10 - 2; v <= 10 + 2; ++v)
          for (int u = centre - 2; u <= centre + 2; ++u)
            for (int h = 0; h < 2 && gate.at(u, v) == 0; ++h) {
              const auto own = static_cast<double>(x.half[h][ch].at(u, v)),
                         target = static_cast<double>(y.half[h][ch].at(u, v));
              sum += sqr(target + f * (own - target) - static_cast<double>(x.half[1 - h][ch].at(u, v))) / unit.at(u, v);
            }
        return sum;
      };
      const double a = error(-1), b = error(0), d = error(1), best = 0.5 * (a - d) / (a - 2 * b + d);
      CHECK(factors[ch].at(centre, 10) == doctest::Approx(std::clamp(best, 0.0, 1.0)).epsilon(1e-6));
    }
}

TEST_CASE("Gated pixels count for nothing, and a lamp does not hide what is wrong beside it") {
  Case c = makeCase();
  Estimate& x = c.estimates.estimates[0];
  const Estimate& y = c.find("narrow");
  Plane<float> gate(x.mean.width(), x.mean.height());
  gate.at(12, 9) = 1;
  const auto before = crossHalfShrinkage(x, y.half, gate, 2);
  for (size_t ch = 0; ch < 3; ++ch) x.half[0][ch].at(12, 9) += 1000;
  const auto after = crossHalfShrinkage(x, y.half, gate, 2), open = crossHalfShrinkage(x, y.half, {}, 2);
  for (size_t ch = 0; ch < 3; ++ch) {
    CHECK(after[ch].data == before[ch].data);
    CHECK(open[ch].data != before[ch].data);
  }
  // In the left half, dark, Y is wrong by five deviations; the right half is a lamp with noise alone.
  CaseOptions o;
  o.width = o.height = 32;
  o.samples = 64;
  o.constant = 1;
  Case lamp = makeCase(o);
  Estimate& n = lamp.estimates.estimates[0];
  Rgb<float> wrong[2] = {lamp.truth, lamp.truth};
  for (size_t ch = 0; ch < 3; ++ch)
    for (int v = 0; v < 32; ++v)
      for (int u = 0; u < 32; ++u) {
        const float scale = u < 16 ? 0.1f : 100;
        for (Rgb<float>* image : {&n.mean, &n.half[0], &n.half[1]}) (*image)[ch].at(u, v) *= scale;
        n.variance[ch].at(u, v) *= scale * scale;
        for (Rgb<float>& image : wrong) image[ch].at(u, v) = u < 16 ? 0.1f * 2.25f : 100;
      }
  CHECK(crossHalfShrinkage(n, wrong, {}, 7)[0].at(13, 16) > 0.5f);
}

TEST_CASE("Fireflies are kept where halves agree on them near and in the block") {
  constexpr int kSize = 32;
  Estimate x;
  Plane<float> gate(kSize, kSize);
  for (Rgb<float>* image : {&x.mean, &x.half[0], &x.half[1]}) *image = Rgb<float>(kSize, kSize);
  const Rgb<float> black[2] = {x.mean, x.mean};
  const auto set = [&](int u, int v, float a, float b) {
    gate.at(u, v) = 1;
    for (size_t c = 0; c < 3; ++c) {
      x.half[0][c].at(u, v) = a;
      x.half[1][c].at(u, v) = b;
      x.mean[c].at(u, v) = 0.5f * (a + b);
    }
  };
  for (int v = 4; v < 12; ++v) set(4, v, 30, 24);  // a lamp's mirror image, one pixel wide
  for (int v = 20; v < 32; v += 2)                 // strong samples, one to a pixel, but for one pixel with two
    for (int u = 18; u < 32; u += 4) set(u, v, v == 26 ? 40.0f : 0.0f, v == 26 ? 0.0f : 40.0f);
  set(22, 26, 40, 40);
  set(28, 4, 40, 40);  // alone in its block
  const auto factors = crossHalfFireflyShrinkage(x, black, gate, 7);
  for (size_t c = 0; c < 3; ++c) {
    CHECK(factors[c].at(4, 8) > 0.9f);
    CHECK(factors[c].at(22, 26) == 0);
    CHECK(factors[c].at(18, 24) == 0);
    CHECK(factors[c].at(28, 4) == 0);
    CHECK(factors[c].at(31, 2) == 0);  // no firefly near
  }
  CHECK(crossHalfShrinkage(x, black, gate, 1, Gated::Only)[0].at(22, 26) == 1);
  CHECK(crossHalfShrinkage(x, black, gate, 1)[0].at(4, 8) == 0);
}

TEST_CASE("Noise that a biased image has of the unbiased one hides less of its error from measured factors") {
  // Half the noise of X beside an error of its own: (X - Y)² is small, and the paper's factor with it.
  CaseOptions o;
  o.samples = 64;
  Case c = makeCase(o);
  Estimate y = c.pt();
  const Rgb<float> sharp = c.truth;
  const auto mix = [&](Rgb<float>& image) {
    for (size_t ch = 0; ch < 3; ++ch)
      for (size_t i = 0; i < image.size(); ++i)
        image[ch][i] = 0.75f * image[ch][i] + 0.25f * (sharp[ch][i] + 4 * std::sqrt(c.pt().variance[ch][i]));
  };
  mix(y.mean);
  for (Rgb<float>& half : y.half) mix(half);
  MethodInputs in = inputsOf(c);
  in.biased = &y;
  in.options.set("js-regression", 0);
  const auto error = [&](double measured) {
    in.options.set("js-measured", measured);
    return meanSquaredError(make_js()->run(in).image.mean, c.truth);
  };
  const double alone = meanSquaredError(c.pt().mean, c.truth);
  CAPTURE(error(0) / alone);
  CAPTURE(error(1) / alone);
  CHECK(error(0) > 1.5 * alone);
  CHECK(error(1) < 1.25 * alone);
}

}  // namespace braid::test_cross_half_shrinkage
