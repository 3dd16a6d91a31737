// SPDX-License-Identifier: Apache-2.0
// NFOR: the halves of its result, each of which keeps noise of its own samples only.
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/denoise/nfor/nfor_filter.h"
#include "tests/combiners/denoise/nfor_cases.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_nfor_halves {

using namespace test;
using namespace test::nfor_cases;

namespace {

double correlation(const Rgb<float>& a, const Rgb<float>& b, const Rgb<float>& truth) {
  double ab = 0, aa = 0, bb = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < truth.size(); ++i) {
      // Relative to the truth, so that bright pixels do not count for all.
      const double t = static_cast<double>(truth[c][i]);
      const double x = (static_cast<double>(a[c][i]) - t) / t, y = (static_cast<double>(b[c][i]) - t) / t;
      ab += x * y;
      aa += x * x;
      bb += y * y;
    }
  return ab / std::sqrt(aa * bb);
}

}  // namespace

TEST_CASE("A half of the result keeps noise of its own samples and none of the other half's") {
  // The errors of both halves are all but uncorrelated, else ensembles would take their sum for a bias. The limit is
  // several times what seeds differ by.
  const Case c = caseOf(96, 72, 16);
  const NforResult r = filtered(c, plain(2));
  for (size_t h = 0; h < 2; ++h) {
    const double own = correlation(r.half[h], c.pt().half[h], c.truth);
    const double other = correlation(r.half[h], c.pt().half[1 - h], c.truth);
    CAPTURE(own);
    CAPTURE(other);
    CHECK(own > 0.05);
    CHECK(std::fabs(other) < 0.03);
  }
}

TEST_CASE("The error of the halves of nfor can be estimated from the other half") {
  // Too small by 10 to 55 %: the selection takes the candidate that is nearer to the other half.
  double estimated = 0, actual = 0;
  for (const uint64_t seed : {1, 2, 3}) {
    CaseOptions o = sized(64, 48, 16);
    o.noise = 1;
    o.seed = seed;
    const Case c = makeCase(o);
    const NforResult r = filtered(c);
    for (size_t h = 0; h < 2; ++h) {
      estimated += meanSquaredError(r.half[h], c.pt().half[1 - h]) -
                   meanSquaredError(c.truth, c.pt().half[1 - h]);  // the noise itself, rather than its estimate
      actual += meanSquaredError(r.half[h], c.truth);
    }
  }
  CAPTURE(estimated / actual);
  CHECK(estimated > 0.4 * actual);
  CHECK(estimated < 1.5 * actual);
}

TEST_CASE("The result lies near the mean of its halves and is better than it") {
  const Case c = caseOf(64, 48, 16);
  const NforResult r = filtered(c);
  const Rgb<float> mean = average(r.half[0], r.half[1]);
  CHECK(relativeError(r.mean, mean) < 0.15);
  CHECK(meanSquaredError(r.mean, c.truth) < meanSquaredError(mean, c.truth));
  CHECK(meanSquaredError(mean, c.truth) < meanSquaredError(r.half[0], c.truth));
}

TEST_CASE("Pixels of one half change that half, and the other one by weights alone") {
  const Case c = caseOf(64, 48, 32);
  Estimate changed = c.pt();
  // A patch of half B is a tenth brighter, the mean as it says.
  for (size_t k = 0; k < 3; ++k)
    for (int y = 20; y < 24; ++y)
      for (int x = 40; x < 44; ++x) {
        const float v = changed.half[1][k].at(x, y);
        changed.half[1][k].at(x, y) += 0.1f * v;
        changed.mean[k].at(x, y) += 0.05f * v;
      }
  const NforResult before = filtered(c, plain(2)), after = nforFilter(changed, &*c.estimates.features, plain(2));
  const auto change = [&](size_t h, int x0, int x1) {
    double sum = 0;
    for (size_t k = 0; k < 3; ++k)
      for (int y = 20; y < 24; ++y)
        for (int x = x0; x < x1; ++x)
          sum += std::fabs(static_cast<double>(after.half[h][k].at(x, y) - before.half[h][k].at(x, y)));
    return sum;
  };
  CAPTURE(change(0, 40, 44) / change(1, 40, 44));
  CHECK(change(1, 40, 44) > 3 * change(0, 40, 44));
  CHECK(change(0, 0, 6) == 0);  // out of reach of the windows
  CHECK(change(1, 0, 6) == 0);
}

}  // namespace braid::test_nfor_halves
