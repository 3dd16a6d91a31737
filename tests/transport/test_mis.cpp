// SPDX-License-Identifier: Apache-2.0
// Weights of two techniques for the same light: one in sum, finite whatever the densities are.
#include <doctest/doctest.h>

#include "renderer/core/vec.h"
#include "renderer/transport/mis.h"

namespace braid::test_mis {

TEST_CASE("MIS weights: the sum is one, and the likelier way counts more than its density says") {
  for (const float pdf : {1e-30f, 1e-3f, 0.5f, 1.0f, 40.0f, 1e9f, 1e30f})
    for (const float other : {1e-30f, 1e-3f, 0.5f, 1.0f, 40.0f, 1e9f, 1e30f}) {
      const float weight = powerHeuristic(pdf, other), rest = powerHeuristic(other, pdf);
      CAPTURE(pdf);
      CAPTURE(other);
      CHECK(weight + rest == doctest::Approx(1).epsilon(1e-6));
      if (pdf > other) CHECK(weight >= pdf / (pdf + other) - 1e-6f);
    }
  CHECK(powerHeuristic(4, 1) == doctest::Approx(8.0 / 9));
}

TEST_CASE("MIS weights: a way that cannot find the light has none, and leaves all to the other") {
  CHECK(powerHeuristic(0, 1) == 0);
  CHECK(powerHeuristic(0, 0) == 0);
  CHECK(powerHeuristic(1, 0) == 1);
  CHECK(powerHeuristic(1, kInfinity) == 0);
  CHECK(powerHeuristic(1e-38f, 1e38f) == 0);
}

}  // namespace braid::test_mis
