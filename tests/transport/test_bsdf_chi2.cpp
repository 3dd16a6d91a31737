// SPDX-License-Identifier: Apache-2.0
// Every sampling routine of the BSDF against its density. A correct BSDF fails this file once in 10 000 sets of seeds;
// the seeds are fixed.
#include <doctest/doctest.h>

#include "renderer/transport/bsdf/bsdf.h"
#include "tests/support/bsdf_cases.h"
#include "tests/support/statistics/chi_squared.h"

namespace braid::test_bsdf_chi2 {

using namespace test;

TEST_CASE("bsdf: samples follow their density") {
  const auto cases = bsdfCases();
  const auto views = viewDirections();
  const double significance = sidak(1e-4, static_cast<int>(cases.size() * views.size()));
  uint64_t seed = 100;
  for (const BsdfCase& c : cases) {
    for (const Vec3& wo : views) {
      const Bsdf bsdf(c.p, wo);
      const auto sample = [&](Rng& rng) -> std::optional<Vec3> {
        BsdfSample s;
        const float uLobe = rng.next();
        if (!bsdf.sample(uLobe, rng.next2(), s) || s.delta) return std::nullopt;
        return s.wi;
      };
      const ChiSquared r = chiSquared(
          sample, [&](const Vec3& wi) { return bsdf.evaluate(wi).pdfW; }, ++seed, 40000, 100);
      INFO(c.name << ", wo.z " << wo.z << ", cells " << r.cells << ", integral " << r.integral);
      CHECK(r.pValue > significance);
      CHECK(r.integral < 1.002);
    }
  }
}

}  // namespace braid::test_bsdf_chi2
