// SPDX-License-Identifier: Apache-2.0
// NFOR: its stored weights and its prefiltered features.
#include <array>
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/denoise/nfor/feature_prefilter.h"
#include "combiners/denoise/nlm/nlm_filter.h"
#include "combiners/denoise/nlm/nlm_window_weights.h"
#include "tests/combiners/denoise/nfor_cases.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_nfor_weights {

using namespace test;
using namespace test::nfor_cases;

TEST_CASE("Stored weights are those of non-local means at every centre, to 16 bits, and at half the sensitivity") {
  for (const auto& [width, height] : {std::array{1, 1}, {7, 3}, {150, 41}}) {
    const Case c = caseOf(width, height, 16);
    const Estimate& e = c.pt();
    const NlmGuide guide = nlmGuide(e.mean, e.variance, 1, 1), half = nlmGuide(e.mean, e.variance, 0.5f, 1);
    const PixelRect all = {0, 0, width, height};
    for (const int stride : {1, 2, 3}) {
      CAPTURE(width);
      CAPTURE(stride);
      const NlmWindowStore store(std::span(&guide, 1), 4, stride);
      NlmWeights weights(std::span(&guide, 1), 4, all), halfWeights(std::span(&half, 1), 4, all);
      double worst = 0, worstHalf = 0;
      for (int dy = -4; dy <= 4; ++dy)
        for (int dx = -4; dx <= 4; ++dx) {
          const float *w = weights.at(dx, dy), *wh = halfWeights.at(dx, dy);
          for (int r = 0; r < centreCount(height, stride); ++r)
            for (int k = 0; k < centreCount(width, stride); ++k) {
              const int cx = centrePosition(k, width, stride), cy = centrePosition(r, height, stride);
              if (cx + dx < 0 || cx + dx >= width || cy + dy < 0 || cy + dy >= height) continue;
              const int x0 = std::max(0, cx - 4), x1 = std::min(width, cx + 5);
              float row[9 + WindowWeights::kRowSlack];
              const auto at = static_cast<size_t>(cy * width + cx), inRow = static_cast<size_t>(cx + dx - x0);
              NlmWindowWeights(store, false).row(cx, cy, cy + dy, x0, x1, row);
              worst = std::max(worst, std::fabs(static_cast<double>(row[inRow] - w[at])));
              NlmWindowWeights(store, true).row(cx, cy, cy + dy, x0, x1, row);
              worstHalf = std::max(worstHalf, std::fabs(static_cast<double>(row[inRow] - wh[at])));
            }
        }
      CHECK(worst < 1e-5);
      CHECK(worstHalf < 0.01);  // the epsilon of distances is divided by k² too, which matters where variance is small
    }
  }
}

TEST_CASE("The zero-order means beside the stored weights are those of the filter, at both sensitivities") {
  const Case c = caseOf(150, 41, 16);
  const Estimate& e = c.pt();
  const NlmGuide guide = nlmGuide(e.mean, e.variance, 1, 1), half = nlmGuide(e.mean, e.variance, 0.5f, 1);
  std::array<Rgb<float>, 2> means = {Rgb<float>(150, 41), Rgb<float>(150, 41)};
  const NlmWindowStore store(std::span(&guide, 1), 4, 2, &e.half[0], &means);
  CHECK(relativeError(means[0], nlmFilter(guide, 4, e.half[0])) < 1e-5);
  CHECK(relativeError(means[1], nlmFilter(half, 4, e.half[0])) < 1e-3);
  CHECK(relativeError(means[1], nlmFilter(guide, 4, e.half[0])) > 1e-2);
}

TEST_CASE("Prefiltered features lose most of their noise, half by half, with weights of the other half") {
  CaseOptions o = sized(96, 72, 16);
  o.featureNoise = 0.2;
  const Case c = makeCase(o);
  o.featureNoise = 0;
  const Case clean = makeCase(o);
  const Features& f = *c.estimates.features;
  const FeatureHalves out = crossPrefiltered(&f), truth = crossPrefiltered(&*clean.estimates.features);
  REQUIRE(out.half[0].planes.size() == 8);
  REQUIRE(out.half[0].groups().size() == 4);
  const auto error = [](const Plane<float>& a, const Plane<float>& b) {
    double sum = 0;
    for (size_t i = 0; i < a.size(); ++i) sum += sqr(static_cast<double>(a[i]) - static_cast<double>(b[i]));
    return sum / static_cast<double>(a.size());
  };
  const FeatureChannels mean = prefilteredMean(out);
  double before = 0, half = 0, both = 0;
  for (size_t k = 0; k < 6; ++k) {
    const Rgb<float>* const halves = k < 3 ? f.albedo.half : f.normal.half;
    const Plane<float>& expected =
        (k < 3 ? clean.estimates.features->albedo : clean.estimates.features->normal).mean[k % 3];
    before += error(halves[0][k % 3], expected);
    half += error(out.half[0].planes[k], expected);
    both += error(mean.planes[k], expected);
    CHECK(error(truth.half[0].planes[k], expected) < 1e-7);  // without noise nothing is blurred
  }
  CAPTURE(before / half);
  CAPTURE(half / both);
  CHECK(half < before / 4);
  CHECK(both < half / 1.3);
  // Crossed: twice the feature in half A is twice the filtered half A.
  Features scaled = f;
  for (float& v : scaled.depth.half[0].data) v *= 2;
  const FeatureHalves again = crossPrefiltered(&scaled);
  for (size_t i = 0; i < out.half[0].planes[6].size(); ++i)
    CHECK(again.half[0].planes[6][i] == doctest::Approx(2 * out.half[0].planes[6][i]).epsilon(1e-5));
}

}  // namespace braid::test_nfor_weights
