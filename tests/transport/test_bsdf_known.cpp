// SPDX-License-Identifier: Apache-2.0
// BSDFs and Fresnel terms where the answer is known.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/transport/bsdf/bsdf.h"
#include "tests/support/bsdf_cases.h"
#include "tests/support/statistics/chi_squared.h"

namespace braid::test_bsdf_known {

using namespace test;

TEST_CASE("bsdf: mirrors, clear glass and total reflection") {
  const Vec3 wo = glm::normalize(Vec3(0.6f, 0.2f, 0.5f));
  BsdfSample s;

  const Bsdf mirror(metal(0), wo);
  CHECK(!mirror.hasNonDelta());
  REQUIRE(mirror.sample(0.3f, Vec2(0.1f, 0.9f), s));
  CHECK(s.delta);
  CHECK(s.pdfW == 1);
  CHECK(glm::length(s.wi - Vec3(-wo.x, -wo.y, wo.z)) < 1e-6f);
  const Spectrum f0(1.0f, 0.78f, 0.34f);
  const Spectrum schlick = f0 + (1.0f - f0) * std::pow(1 - wo.z, 5.0f);
  CHECK(glm::length(s.weight - schlick) < 1e-5f);

  // Entering: Snell's law, and the two choices share what arrives.
  const Bsdf clear(glass(0, true), wo, Transport::Power);
  REQUIRE(clear.sample(kOneMinusEpsilon, Vec2(0.5f), s));
  CHECK(s.delta);
  CHECK(s.transmitted);
  const float sinO = std::sqrt(1 - sqr(wo.z)), sinT = std::sqrt(sqr(s.wi.x) + sqr(s.wi.y));
  CHECK(sinO == doctest::Approx(1.5f * sinT));
  const float fresnel = fresnelDielectric(wo.z, 1.5f);
  CHECK(s.weight.z * s.pdfW == doctest::Approx(1 - fresnel).epsilon(1e-4));
  REQUIRE(clear.sample(0, Vec2(0.5f), s));
  CHECK(!s.transmitted);
  CHECK(s.weight.z * s.pdfW == doctest::Approx(fresnel).epsilon(1e-4));

  // Leaving beyond the critical angle: everything is reflected, whatever specular says.
  SurfaceParameters dim = glass(0, false);
  dim.specular = 0.2f;
  const Bsdf inside(dim, wo);
  for (const float u : {0.0f, 0.5f, kOneMinusEpsilon}) {
    REQUIRE(inside.sample(u, Vec2(0.5f), s));
    CHECK(!s.transmitted);
    CHECK(s.weight.y == doctest::Approx(1));
  }

  // Equal indices and smooth: as if nothing were there, but for the tint.
  const Bsdf nothing(glass(0, true, 1.0f), wo);
  REQUIRE(nothing.sample(0.2f, Vec2(0.3f), s));
  CHECK(s.transmitted);
  CHECK(glm::length(s.wi + wo) < 1e-6f);
  CHECK(glm::length(s.weight - Spectrum(0.9f, 0.95f, 1.0f)) < 1e-5f);

  const Bsdf thin(thinGlass(0), wo);
  REQUIRE(thin.sample(kOneMinusEpsilon, Vec2(0.3f), s));
  CHECK(s.delta);
  CHECK(glm::length(s.wi + wo) < 1e-6f);
  CHECK(thin.radianceScale() == 1);
}

TEST_CASE("bsdf: specular, metallic and transmission end points") {
  const Vec3 wo = glm::normalize(Vec3(0.3f, 0.2f, 0.8f)), wi = glm::normalize(Vec3(-0.5f, 0.4f, 0.7f));
  // specular 0 is plain Lambert.
  SurfaceParameters p = plastic(0.4f);
  p.specular = 0;
  CHECK(Bsdf(p, wo).diffuseOnly());
  CHECK(glm::length(Bsdf(p, wo).evaluate(wi).f - Bsdf(lambert(), wo).evaluate(wi).f) < 1e-6f);
  // A metal does not see transmission, diffuse transmission nor the dielectric's index.
  SurfaceParameters m = metal(0.4f), n = m;
  n.lobes |= kLobeTransmission | kLobeDiffuseTransmission;
  n.transmission = n.diffuseTransmission = 0.8f;
  n.etaInside = 3;
  CHECK(glm::length(Bsdf(m, wo).evaluate(wi).f - Bsdf(n, wo).evaluate(wi).f) < 1e-6f);
  CHECK(isBlack(Bsdf(n, wo).evaluate(mirrored(wi)).f));
  // The diffuse colours of a leaf.
  const SurfaceParameters leaf = withDiffuseTransmission(lambert(), 0.25f);
  CHECK(glm::length(Bsdf(leaf, wo).evaluate(wi).f - 0.75f * leaf.baseColor * wi.z * kInvPi) < 1e-6f);
  CHECK(glm::length(Bsdf(leaf, wo).evaluate(mirrored(wi)).f - 0.25f * leaf.diffuseTransmissionColor * wi.z * kInvPi) <
        1e-6f);
  // Below the horizon an opaque surface shows nothing.
  for (const SurfaceParameters& q : {lambert(), plastic(0.3f), withSheen(plastic(0.5f), 0.4f)}) {
    CHECK(isBlack(Bsdf(q, wo).evaluate(mirrored(wi)).f));
  }
}

TEST_CASE("bsdf: a viewer below the shading horizon sees no black rim") {
  const Vec3 wi = glm::normalize(Vec3(-0.5f, 0.4f, 0.7f));
  for (const SurfaceParameters& p : {lambert(), plastic(0.3f), metal(0.5f)}) {
    const Vec3 below = glm::normalize(Vec3(0.8f, 0.3f, -0.01f)), above = mirrored(below);
    CHECK(Bsdf(p, below).evaluate(wi).f == Bsdf(p, above).evaluate(wi).f);
  }
}

TEST_CASE("bsdf: albedo feature") {
  const Vec3 wo = glm::normalize(Vec3(0.2f, 0.1f, 0.9f));
  CHECK(Bsdf(lambert(), wo).albedo() == lambert().baseColor);
  SurfaceParameters clear = glass(0, true);
  clear.baseColor = Spectrum(1);
  CHECK(glm::length(Bsdf(clear, wo).albedo() - Spectrum(1)) < 1e-4f);
  for (const float roughness : {0.0f, 0.5f, 1.0f}) {
    CHECK(glm::length(Bsdf(metal(roughness), wo).albedo() - Spectrum(1.0f, 0.78f, 0.34f)) < 0.01f);
  }
}

TEST_CASE("fresnel: known values") {
  CHECK(fresnelDielectric(1, 1.5f) == doctest::Approx(0.04));
  CHECK(fresnelDielectric(1, 1 / 1.5f) == doctest::Approx(0.04));
  CHECK(fresnelDielectric(0, 1.5f) == doctest::Approx(1));
  CHECK(fresnelDielectric(0.5f, 1 / 1.5f) == 1);
  CHECK(fresnelDielectric(0, 1) == 0);
  // Brewster's angle leaves half of the perpendicular polarisation: ((n² - 1) / (n² + 1))² / 2.
  CHECK(fresnelDielectric(1 / std::sqrt(1 + 1.5f * 1.5f), 1.5f) == doctest::Approx(0.5 * sqr(1.25 / 3.25)));
  CHECK(fresnelF0(1.5f, 1) == doctest::Approx(0.04));
  CHECK(fresnelF0(0, 1) == 1);
  CHECK(fresnelF0(0, 0) == 1);
  // The same pair of angles reflects the same from either side.
  for (const float cosine : {0.1f, 0.4f, 0.9f}) {
    CHECK(fresnelDielectric(cosine, 1.5f) ==
          doctest::Approx(fresnelDielectric(refractedCosine(cosine, 1.5f), 1 / 1.5f)).epsilon(1e-4));
  }
}

TEST_CASE("fresnel: a thin film") {
  const Spectrum f0(0.04f, 0.5f, 0.9f);
  // No film, by thickness or by index: Schlick's curve of the base.
  for (const ThinFilm& none : {ThinFilm{1, 1.3f, 0}, ThinFilm{1, 1, 400}}) {
    for (const float cosine : {1.0f, 0.6f, 0.1f}) {
      const Spectrum schlick = f0 + (1.0f - f0) * schlickWeight(cosine);
      CHECK(glm::length(fresnelThinFilm(none, f0, cosine) - schlick) < 1e-4f);
    }
  }
  // A quarter-wave coating of index sqrt(n) blackens the reflection of green.
  const float n = 1.5f * 1.5f;
  const Spectrum base(fresnelF0(n, 1));
  const Spectrum coated = fresnelThinFilm({1, 1.5f, 550 / (4 * 1.5f)}, base, 1);
  CHECK(coated.y < 0.1f * base.y);
  // Very thick films lose their colour.
  const Spectrum thick = fresnelThinFilm({1, 1.33f, 50000}, Spectrum(0.04f), 0.9f);
  CHECK(maxComponent(thick) - minComponent(thick) < 1e-3f);
  // Total reflection at a film of lower index.
  CHECK(fresnelThinFilm({1.5f, 1, 400}, f0, 0.3f) == Spectrum(1));
  // Every angle and thickness stays in [0, 1].
  Rng rng(10);
  for (int i = 0; i < 5000; ++i) {
    const ThinFilm film{1 + 0.5f * rng.next(), 1 + 1.5f * rng.next(), 2000 * rng.next()};
    const Spectrum r = fresnelThinFilm(film, Spectrum(rng.next(), rng.next(), rng.next()), rng.next());
    CHECK(usable(r));
    CHECK(maxComponent(r) <= 1);
  }
}

}  // namespace braid::test_bsdf_known
