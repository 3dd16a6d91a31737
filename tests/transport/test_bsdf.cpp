// SPDX-License-Identifier: Apache-2.0
// What a BSDF promises: agreement of its operations, reciprocity, energy, finite values, and the cases with a known
// answer. Random inputs have fixed seeds. Whether samples follow their density: test_bsdf_chi2.cpp.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/transport/bsdf/bsdf.h"
#include "tests/support/bsdf_cases.h"
#include "tests/support/sampled_albedo.h"
#include "tests/support/statistics/chi_squared.h"

namespace braid::test_bsdf {

using namespace test;

namespace {

Vec3 exchangedDirection(const Vec3& wo, const Vec3& wi) { return wi.z > 0 ? wo : mirrored(wo); }

}  // namespace

TEST_CASE("bsdf: sample, evaluate and density agree") {
  Rng rng(1);
  for (const BsdfCase& c : bsdfCases()) {
    double worstPdf = 0, worstWeight = 0;
    for (const Vec3& wo : viewDirections()) {
      const Bsdf bsdf(c.p, wo);
      for (int i = 0; i < 300; ++i) {
        BsdfSample s;
        const float uLobe = rng.next();
        if (!bsdf.sample(uLobe, rng.next2(), s)) continue;
        CHECK(std::fabs(glm::length(s.wi) - 1) < 1e-5f);
        CHECK(s.transmitted == (s.wi.z < 0));
        if (s.delta) continue;
        REQUIRE(bsdf.hasNonDelta());
        const BsdfValue v = bsdf.evaluate(s.wi);
        worstPdf = std::max(worstPdf, relative(v.pdfW, s.pdfW));
        worstWeight = std::max(worstWeight, relative(maxComponent(v.f / v.pdfW), maxComponent(s.weight)));
      }
    }
    INFO(c.name);
    // At roughness 0.05 a half vector is known to about 1e-4 of the lobe's width.
    CHECK(worstPdf < 1e-2);
    CHECK(worstWeight < 2e-3);
  }
}

TEST_CASE("bsdf: the reverse density is that with the roles exchanged") {
  Rng rng(2);
  for (const BsdfCase& c : bsdfCases()) {
    double worst = 0;
    for (int i = 0; i < 500; ++i) {
      const Vec3 wo = squareToUniformHemisphere(rng.next2()), wi = squareToUniformSphere(rng.next2());
      const Bsdf bsdf(c.p, wo);
      if (!bsdf.hasNonDelta() || std::min(wo.z, std::fabs(wi.z)) < 1e-4f) continue;
      const double expected = exchanged(c.p, wi).evaluate(exchangedDirection(wo, wi)).pdfW;
      worst = std::max(worst, relative(bsdf.evaluate(wi, true).pdfRevW, expected));
      CHECK(bsdf.evaluate(wi, true).pdfW == bsdf.evaluate(wi).pdfW);
    }
    INFO(c.name);
    CHECK(worst < 2e-3);
  }
}

TEST_CASE("bsdf: reflection is reciprocal, transmission up to the index squared") {
  Rng rng(3);
  for (const BsdfCase& c : bsdfCases()) {
    // A coat with its own normal has its own cosine and is reciprocal in that only.
    if (c.p.clearcoatNormal.z < 1) continue;
    double worst = 0;
    for (int i = 0; i < 500; ++i) {
      const Vec3 wo = squareToUniformHemisphere(rng.next2()), wi = squareToUniformSphere(rng.next2());
      if (wo.z < 0.01f || std::fabs(wi.z) < 0.01f) continue;
      // f here includes one cosine: f(wo, wi) |wo.z| must be symmetric. Power transport carries no 1/eta².
      const Spectrum there = Bsdf(c.p, wo, Transport::Radiance).evaluate(wi).f * wo.z;
      const Spectrum back =
          exchanged(c.p, wi, Transport::Power).evaluate(exchangedDirection(wo, wi)).f * std::fabs(wi.z);
      for (int k = 0; k < 3; ++k) worst = std::max(worst, relative(there[k] + 1e-3f, back[k] + 1e-3f));
    }
    INFO(c.name);
    CHECK(worst < 5e-3);
  }
}

TEST_CASE("bsdf: radiance and power transport differ by the index squared in specular transmission") {
  Rng rng(4);
  for (const bool entering : {true, false}) {
    for (const float roughness : {0.0f, 0.4f}) {
      const SurfaceParameters p = glass(roughness, entering);
      const Vec3 wo = glm::normalize(Vec3(0.2f, 0.1f, 0.9f));
      const Bsdf radiance(p, wo), power(p, wo, Transport::Power);
      const float expected = entering ? 1 / sqr(1.5f) : sqr(1.5f);
      CHECK(radiance.radianceScale() == doctest::Approx(expected));
      for (int i = 0; i < 200; ++i) {
        const float uLobe = rng.next();
        const Vec2 u = rng.next2();
        BsdfSample a, b;
        const bool hit = radiance.sample(uLobe, u, a);
        REQUIRE(power.sample(uLobe, u, b) == hit);
        if (!hit) continue;
        const float scale = a.transmitted ? expected : 1.0f;
        CHECK(a.weight.y == doctest::Approx(b.weight.y * scale).epsilon(1e-4));
      }
    }
  }
}

TEST_CASE("bsdf: the albedo of samples is the integral of the values") {
  Rng rng(5);
  for (const BsdfCase& c : bsdfCases()) {
    for (const Vec3& wo : viewDirections()) {
      const Bsdf bsdf(c.p, wo, Transport::Power);
      const Albedo sampled = sampledAlbedo(bsdf, 80, false, rng);
      std::vector<Vec3> directions;
      for (int i = 0; i < 4000; ++i) {
        BsdfSample s;
        const float uLobe = rng.next();
        if (bsdf.sample(uLobe, rng.next2(), s) && !s.delta) directions.push_back(s.wi);
      }
      const SphereCells cells(directions, 100);
      double integral = 0;
      for (const double x : cells.integrate([&](const Vec3& wi) { return bsdf.evaluate(wi).f.y; }, 5e-3)) integral += x;
      INFO(c.name << " wo.z " << wo.z);
      CHECK(std::fabs(integral - sampled.mean.y) < 4.5 * sampled.error.y + 3e-3);
      CHECK(sampled.largestWeight < 12);
    }
  }
}

// White surfaces of every kind, at every roughness.
static std::vector<BsdfCase> whiteSurfaces() {
  const Spectrum white(1);
  std::vector<BsdfCase> cases;
  for (const float r : {0.0f, 0.03f, 0.1f, 0.25f, 0.5f, 0.75f, 1.0f}) {
    const std::string at = " " + std::to_string(r).substr(0, 4);
    const auto add = [&](const std::string& name, SurfaceParameters p) {
      p.baseColor = white;
      cases.push_back({name + at, p});
    };
    for (const float m : {0.0f, 0.4f, 1.0f}) add("metallic " + std::to_string(m).substr(0, 3), metal(r, m));
    for (const bool entering : {true, false}) {
      for (const float t : {0.5f, 1.0f}) add("glass", glass(r, entering, 1.5f, t));
      add("diamond", glass(r, entering, 2.4f, 0.7f));
      add("bubble", glass(r, entering, 0.7f, 0.7f));
      add("coated glass", withClearcoat(withSheen(glass(r, entering), r, white), r));
      add("filmed glass", withFilm(glass(r, entering, 1.5f, 0.5f), 500));
    }
    for (const float m : {0.0f, 0.4f, 1.0f}) add("multi-scatter metallic", withMultiScatter(metal(r, m)));
    add("multi-scatter brushed", withMultiScatter(withAnisotropy(metal(r), 0.7f, 0.3f)));
    add("multi-scatter oil on metal", withMultiScatter(withFilm(metal(r), 800, 1.8f)));
    add("thin", withDiffuseTransmission(thinGlass(r, 0.5f), 0.5f));
    add("sheen", withSheen(lambert(), r, white));
    add("sheen over plastic", withSheen(plastic(0.5f), r, white));
    add("coat over plastic", withClearcoat(plastic(0.3f), r));
    add("plastic under coat", withClearcoat(plastic(r), 0.1f));
    add("tilted coat", withClearcoat(plastic(r), 0.1f, 1, Vec3(0.6f, 0, 1)));
    for (const float strength : {0.5f, 1.0f}) add("brushed", withAnisotropy(plastic(r), strength, 0.3f));
    for (const float thickness : {100.0f, 350.0f, 900.0f}) add("film", withFilm(plastic(r), thickness, 1.8f));
    SurfaceParameters strong = plastic(r);
    strong.etaInside = 0;
    strong.specularColor = Spectrum(0.7f, 0.9f, 2.0f);
    add("index 0", strong);
  }
  return cases;
}

TEST_CASE("bsdf: no more light leaves than arrives") {
  Rng rng(6);
  double largest = 0;  // beyond noise
  for (const BsdfCase& c : whiteSurfaces()) {
    for (const float z : {1.0f, 0.8f, 0.5f, 0.3f, 0.15f, 0.05f, 0.01f, 1e-4f}) {
      const float side = std::sqrt(1 - z * z);
      const Bsdf bsdf(c.p, Vec3(0.6f * side, 0.8f * side, z), Transport::Power);
      const Albedo a = sampledAlbedo(bsdf, 40, true, rng);
      INFO(c.name << " wo.z " << z << " weight " << a.largestWeight);
      for (int k = 0; k < 3; ++k) {
        // Interpolated tables: up to 0.6 % too much where albedos turn sharply.
        CHECK(a.mean[k] <= 1.006 + 4.5 * a.error[k]);
        largest = std::max(largest, a.mean[k] - 3 * a.error[k]);
      }
      CHECK(a.largestWeight < 25);
      CHECK(usable(bsdf.albedo()));
      CHECK(maxComponent(bsdf.albedo()) <= 1);
    }
  }
  CHECK(largest < 1.006);
}

// A surface of these lobes; `variant` sets everything else.
SurfaceParameters extremeSurface(uint32_t lobes, float roughness, float index, int variant) {
  SurfaceParameters p;
  p.lobes = lobes;
  p.roughness = p.clearcoatRoughness = p.sheenRoughness = roughness;
  p.etaInside = index;
  p.entering = variant & 1;
  p.thinWalled = variant & 2;
  p.baseColor = p.sheenColor = p.specularF0 = p.diffuseTransmissionColor = Spectrum((variant & 4) ? 1.0f : 0.0f);
  p.metallic = 0.5f * static_cast<float>(variant % 3);
  p.transmission = 0.5f * static_cast<float>(variant / 3 % 3);
  p.clearcoat = p.iridescence = p.anisotropy = p.diffuseTransmission = (variant & 8) ? 1.0f : 0.3f;
  p.iridescenceIor = (variant & 16) ? 1.0f : 1.5f;
  p.iridescenceThickness = (variant & 8) ? 0.0f : 300.0f;
  return p;
}

void checkUsable(const Bsdf& bsdf, const Vec3& wo, Rng& rng) {
  CHECK(usable(bsdf.albedo()));
  for (const Vec3& wi : {squareToUniformSphere(rng.next2()), Vec3(-wo.x, -wo.y, wo.z), -wo, wo, Vec3(1, 0, 0)}) {
    const BsdfValue v = bsdf.evaluate(wi, true);
    const bool good = usable(v.f) && std::isfinite(v.pdfW) && v.pdfW >= 0 && std::isfinite(v.pdfRevW) && v.pdfRevW >= 0;
    CHECK(good);
  }
  for (const Vec2& u : {rng.next2(), Vec2(0), Vec2(kOneMinusEpsilon)}) {
    BsdfSample s;
    if (!bsdf.sample(rng.next(), u, s)) continue;
    const bool good = usable(s.weight) && isFinite(s.wi) && std::isfinite(s.pdfW) && s.pdfW > 0 &&
                      std::fabs(glm::length(s.wi) - 1) < 1e-4f;
    CHECK(good);
  }
}

TEST_CASE("bsdf: every extreme stays finite and non-negative") {
  Rng rng(7);
  const float roughnesses[] = {0, 1e-4f, 1e-3f, 0.03f, 0.032f, 1};
  const float indices[] = {0, 1, 1 + 1e-6f, 1.01f, 3};
  const uint32_t lobes[] = {kLobeDiffuse,
                            kLobeDiffuse | kLobeSpecular,
                            kLobeDiffuse | kLobeSpecular | kLobeTransmission,
                            kLobeTransmission,
                            kLobeDiffuse | kLobeSpecular | kLobeSpecularGlossiness,
                            0xffu,
                            0xffu | kLobeMultiScatter,
                            kLobeDiffuse | kLobeSpecular | kLobeSheen | kLobeClearcoat | kLobeDiffuseTransmission,
                            0};
  for (const uint32_t set : lobes) {
    for (const float roughness : roughnesses) {
      for (const float index : indices) {
        for (int variant = 0; variant < 24; ++variant) {
          const SurfaceParameters p = extremeSurface(set, roughness, index, variant);
          for (const float z : {1.0f, 0.3f, 1e-4f, 0.0f, -0.2f}) {
            const float side = std::sqrt(1 - z * z), phi = 7 * rng.next();
            const Vec3 wo(side * std::cos(phi), side * std::sin(phi), z);
            const Bsdf bsdf(p, wo);
            INFO("lobes " << set << " roughness " << roughness << " index " << index << " variant " << variant << " z "
                          << z);
            checkUsable(bsdf, wo, rng);
          }
        }
      }
    }
  }
}

TEST_CASE("bsdf: density times the Jacobian of sampling is one") {
  Rng rng(8);
  const auto check = [&](const SurfaceParameters& p) {
    const Bsdf bsdf(p, glm::normalize(Vec3(0.5f, -0.3f, 0.7f)));
    double worst = 0;
    for (int i = 0; i < 400; ++i) {
      const Vec2 u = 0.05f + 0.85f * rng.next2();
      constexpr float kStep = 1e-3f;
      glm::dvec3 w[4];
      bool all = true;
      const Vec2 offsets[] = {{kStep, 0}, {-kStep, 0}, {0, kStep}, {0, -kStep}};
      BsdfSample s;
      for (int k = 0; k < 4; ++k) {
        all = all && bsdf.sample(0.5f, u + offsets[k], s);
        w[k] = glm::dvec3(s.wi);
      }
      if (!all || !bsdf.sample(0.5f, u, s)) continue;
      const double area = glm::length(glm::cross(w[0] - w[1], w[2] - w[3])) / (4.0 * double(kStep) * double(kStep));
      worst = std::max(worst, std::fabs(area * double(s.pdfW) - 1));
    }
    CHECK(worst < 2e-2);
  };
  check(metal(0.3f));
  check(metal(1.0f));
  check(withAnisotropy(metal(0.4f), 0.7f, 0.5f));
  // Without reflection every microfacet transmits.
  SurfaceParameters through = thinGlass(0.5f);
  through.specular = 0;
  check(through);
}

TEST_CASE("bsdf: white furnace of a white dielectric loses only what single scattering loses") {
  Rng rng(9);
  for (const float roughness : {0.0f, 0.3f, 0.6f}) {
    for (const float z : {1.0f, 0.5f, 0.2f}) {
      const Bsdf bsdf(plastic(roughness, Spectrum(1)), Vec3(std::sqrt(1 - z * z), 0, z));
      const Albedo a = sampledAlbedo(bsdf, 100, true, rng);
      INFO("roughness " << roughness << " z " << z);
      // The base returns what the layer lets through: nothing is lost at all.
      CHECK(a.mean.y == doctest::Approx(1).epsilon(4.5 * a.error.y + 4e-3));
    }
  }
}

}  // namespace braid::test_bsdf
