// SPDX-License-Identifier: Apache-2.0
// A BSDF restricted to a group of its lobes: the groups add up to the whole, and each is a BSDF that samples what it
// evaluates. A correct BSDF fails the statistical cases once in 10 000 sets of seeds; the seeds are fixed.
#include <cmath>
#include <tuple>

#include <doctest/doctest.h>

#include "renderer/transport/bsdf/bsdf.h"
#include "tests/support/bsdf_cases.h"
#include "tests/support/statistics/chi_squared.h"

namespace braid::test_lobe_groups {

using namespace test;

namespace {

constexpr LobeGroup kGroups[] = {LobeGroup::Broad, LobeGroup::Narrow};

// Mean weight of samples, stratified in the directions, and its standard error.
std::pair<double, double> albedo(const Bsdf& bsdf, Rng& rng) {
  constexpr int kSide = 64;
  double sum = 0, squares = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    BsdfSample s;
    const Vec2 cell(static_cast<float>(i % kSide), static_cast<float>(i / kSide));
    const float uLobe = rng.next();
    if (!bsdf.sample(uLobe, (cell + rng.next2()) / static_cast<float>(kSide), s)) continue;
    const double w = static_cast<double>(average(s.weight));
    sum += w;
    squares += w * w;
  }
  const double n = kSide * kSide, mean = sum / n;
  return {mean, std::sqrt(std::max(squares / n - mean * mean, 0.0) / n)};
}

}  // namespace

TEST_CASE("lobe groups: values and densities of the groups add up to those of all lobes") {
  Rng rng(11);
  for (const BsdfCase& c : bsdfCases()) {
    double worstValue = 0, worstPdf = 0;
    for (const Vec3& wo : viewDirections()) {
      const Bsdf all(c.p, wo), broad = all.restricted(LobeGroup::Broad), narrow = all.restricted(LobeGroup::Narrow);
      const auto share = static_cast<double>(all.broadShare());
      CHECK((all.hasNonDelta() == (broad.hasNonDelta() || narrow.hasNonDelta())));
      for (int i = 0; i < 200; ++i) {
        const Vec3 wi = squareToUniformSphere(rng.next2());
        const BsdfValue a = all.evaluate(wi), b = broad.evaluate(wi), n = narrow.evaluate(wi);
        for (int k = 0; k < 3; ++k)
          worstValue =
              std::max(worstValue, relative(static_cast<double>(a.f[k]), static_cast<double>(b.f[k] + n.f[k])));
        worstPdf =
            std::max(worstPdf, relative(static_cast<double>(a.pdfW), share * static_cast<double>(b.pdfW) +
                                                                         (1 - share) * static_cast<double>(n.pdfW)));
      }
    }
    INFO(c.name);
    CHECK(worstValue < 1e-5);
    CHECK(worstPdf < 1e-5);
  }
}

TEST_CASE("lobe groups: samples agree with values, broad ones are never delta, the others never broad") {
  Rng rng(12);
  for (const BsdfCase& c : bsdfCases()) {
    INFO(c.name);
    for (const Vec3& wo : viewDirections())
      for (const LobeGroup group : kGroups) {
        const Bsdf bsdf = Bsdf(c.p, wo).restricted(group);
        CHECK(bsdf.broadShare() == (group == LobeGroup::Broad && Bsdf(c.p, wo).broadShare() > 0 ? 1.0f : 0.0f));
        for (int i = 0; i < 100; ++i) {
          BsdfSample s;
          const float uLobe = rng.next();
          if (!bsdf.sample(uLobe, rng.next2(), s)) continue;
          if (group == LobeGroup::Broad) REQUIRE_FALSE(s.delta);
          if (s.delta) continue;
          const BsdfValue v = bsdf.evaluate(s.wi);
          CHECK(relative(static_cast<double>(v.pdfW), static_cast<double>(s.pdfW)) < 1e-2);
          CHECK(relative(static_cast<double>(maxComponent(v.f / v.pdfW)), static_cast<double>(maxComponent(s.weight))) <
                2e-3);
        }
      }
  }
}

TEST_CASE("lobe groups: picking a group and dividing by its share scatters as much as all lobes") {
  Rng rng(13);
  int count = 0;
  for (const BsdfCase& c : bsdfCases()) {
    for (const Vec3& wo : viewDirections()) {
      const Bsdf all(c.p, wo);
      const auto [whole, wholeError] = albedo(all, rng);
      const auto [broad, broadError] = albedo(all.restricted(LobeGroup::Broad), rng);
      const auto [narrow, narrowError] = albedo(all.restricted(LobeGroup::Narrow), rng);
      const double error = std::sqrt(sqr(wholeError) + sqr(broadError) + sqr(narrowError));
      INFO(c.name << ", wo.z " << wo.z << ": " << whole << " = " << broad << " + " << narrow << " +- " << error);
      // Single false alarms at 4.9 standard deviations: 1e-6 each, 2e-4 in all.
      CHECK(std::fabs(broad + narrow - whole) < 4.9 * error + 1e-5);
      ++count;
    }
  }
  CHECK(count > 100);
}

TEST_CASE("lobe groups: samples follow their density") {
  const auto cases = bsdfCases();
  const Vec3 views[] = {viewDirections()[1], viewDirections()[2]};
  const double significance = sidak(1e-4, static_cast<int>(cases.size() * 4));
  uint64_t seed = 900;
  for (const BsdfCase& c : cases)
    for (const Vec3& wo : views)
      for (const LobeGroup group : kGroups) {
        const Bsdf bsdf = Bsdf(c.p, wo).restricted(group);
        ++seed;
        if (!bsdf.hasNonDelta()) continue;
        const auto sample = [&](Rng& rng) -> std::optional<Vec3> {
          BsdfSample s;
          const float uLobe = rng.next();
          if (!bsdf.sample(uLobe, rng.next2(), s) || s.delta) return std::nullopt;
          return s.wi;
        };
        const ChiSquared r = chiSquared(
            sample, [&](const Vec3& wi) { return bsdf.evaluate(wi).pdfW; }, seed, 20000, 60);
        INFO(c.name << ", wo.z " << wo.z << ", broad " << (group == LobeGroup::Broad) << ", cells " << r.cells
                    << ", integral " << r.integral);
        CHECK(r.pValue > significance);
        CHECK(r.integral < 1.002);
      }
}

TEST_CASE("lobe groups: the reverse density is that of the same group with the roles exchanged") {
  Rng rng(14);
  for (const BsdfCase& c : bsdfCases())
    for (const LobeGroup group : kGroups) {
      double worst = 0;
      for (int i = 0; i < 200; ++i) {
        const Vec3 wo = squareToUniformHemisphere(rng.next2()), wi = squareToUniformSphere(rng.next2());
        const Bsdf bsdf = Bsdf(c.p, wo).restricted(group);
        if (!bsdf.hasNonDelta() || std::min(wo.z, std::fabs(wi.z)) < 1e-4f) continue;
        const Vec3 back = wi.z > 0 ? wo : Vec3(wo.x, wo.y, -wo.z);
        const float expected = exchanged(c.p, wi).restricted(group).evaluate(back).pdfW;
        worst = std::max(worst,
                         relative(static_cast<double>(bsdf.evaluate(wi, true).pdfRevW), static_cast<double>(expected)));
      }
      INFO(c.name);
      CHECK(worst < 2e-3);
    }
}

TEST_CASE("lobe groups: what is broad") {
  const Vec3 wo = viewDirections()[1];
  const auto share = [&](const SurfaceParameters& p) { return Bsdf(p, wo).broadShare(); };
  CHECK(share(lambert()) == 1);
  CHECK(share(withDiffuseTransmission(lambert(), 0.4f)) == 1);
  CHECK(share(withSheen(lambert(), 0.3f)) == 1);
  CHECK(share(metal(0)) == 0);
  CHECK(share(metal(0.5f)) == 0);  // alpha 0.25
  CHECK(share(metal(0.6f)) == 1);  // alpha 0.36
  CHECK(share(glass(0.1f, true)) == 0);
  CHECK(share(plastic(0.6f)) == 1);
  CHECK((share(plastic(0.2f)) > 0.5f && share(plastic(0.2f)) < 1));
  CHECK((share(withClearcoat(lambert(), 0.1f)) > 0.5f && share(withClearcoat(lambert(), 0.1f)) < 1));
  CHECK(share(lambert(Spectrum(0))) == 1);  // black, but diffuse
}

}  // namespace braid::test_lobe_groups
