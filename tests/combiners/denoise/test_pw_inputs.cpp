// SPDX-License-Identifier: Apache-2.0
// What the patch-Welch filter reads: demodulated radiance, regularised variance, halves.
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/denoise/pw/pw_filter.h"
#include "combiners/denoise/pw/pw_method.h"
#include "combiners/pipeline/registry.h"
#include "combiners/statistics/variance.h"
#include "renderer/core/error.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_pw_inputs {

using namespace test;

TEST_CASE("Emitters and misses keep their radiance undivided, black albedo is floored") {
  Case c = caseOf(8, 1, 8);
  Features& f = *c.estimates.features;
  f.depth.mean[0] = 0;                                    // a miss
  f.albedo.mean.set(1, Vec3(0.5f, 1.5f, 0.5f));           // an emitter
  f.albedo.mean.set(2, Vec3(0, 0.2f, 1));                 // neither
  f.albedo.mean.set(3, Vec3(std::nanf(""), 0.2f, 0.3f));  // nonsense
  const PatchWelchInput input = patchWelchInput(c.pt(), &f);
  const PatchWelchTile tile(input, {0, 0, 8, 1}, 0);
  const auto divisor = [&](int x) {
    const auto i = static_cast<size_t>(tile.index(x, 0));
    return Vec3(tile.divisor[0][i], tile.divisor[1][i], tile.divisor[2][i]);
  };
  CHECK(divisor(0) == Vec3(1));
  CHECK(divisor(1) == Vec3(1));
  CHECK(divisor(2) == Vec3(0.03f, 0.2f, 1));
  CHECK(divisor(3) == Vec3(0.03f, 0.2f, 0.3f));
}

TEST_CASE("The regularised variance has the right mean at any number of passes, and is nowhere zero beside noise" *
          doctest::test_suite("statistics")) {
  for (const uint64_t samples : {2, 3, 4, 16}) {
    double estimated = 0, actual = 0;
    bool positive = true;
    for (uint64_t seed = 1; seed <= 6; ++seed) {
      const Case c = caseOf(96, 72, samples, seed);
      const Rgb<float> variance = regularisedVariance(c.pt());
      estimated += meanOfImage(variance);
      actual += meanSquaredError(c.pt().mean, c.truth);
      for (size_t k = 0; k < 3; ++k)
        for (const float v : variance[k].data) positive = positive && v > 0;
    }
    CAPTURE(samples);
    CAPTURE(estimated / actual);
    // 124,416 squares of a factor with kurtosis below 20, with up to 3x between dark and bright: 4 standard errors.
    CHECK(estimated == doctest::Approx(actual).epsilon(0.06));
    CHECK(positive);
  }
}

TEST_CASE("Two and three passes are denoised by the variance of the halves, one is refused") {
  const std::unique_ptr<Method> method = patchWelchMethod("pw", "the filter under test", kPatchWelchThreshold);
  for (const uint64_t samples : {2, 3}) {
    const Case c = caseOf(96, 72, samples);
    const MethodResult result = method->run(inputsOf(c));
    CHECK(meanSquaredError(result.image.mean, c.truth) < 0.5 * meanSquaredError(c.pt().mean, c.truth));
    CHECK(allFinite(result.image.half[1]));
  }
  CHECK_THROWS_AS(method->run(inputsOf(caseOf(16, 12, 1))), Error);
}

TEST_CASE("Where only the mean is read, halves are left out and the mean keeps its bits") {
  const Case c = caseOf(70, 40, 8);
  for (const auto& make : {make_pw, make_pw1, make_nlm, make_box}) {
    const std::unique_ptr<Method> method = make();
    CAPTURE(method->name());
    MethodInputs in = inputsOf(c);
    const MethodResult all = method->run(in);
    in.meanOnly = true;
    const MethodResult meanOnly = method->run(in);
    CHECK_FALSE(all.image.half[1].empty());
    CHECK(meanOnly.image.half[1].empty());
    for (size_t k = 0; k < 3; ++k) CHECK(meanOnly.image.mean[k].data == all.image.mean[k].data);
  }
}

}  // namespace braid::test_pw_inputs
