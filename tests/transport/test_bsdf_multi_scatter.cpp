// SPDX-License-Identifier: Apache-2.0
// What rough metals and rough glass keep of the light that single scattering loses. Reciprocity, densities and finite
// values: test_bsdf.cpp, whose cases have this, too.
#include <cmath>

#include <doctest/doctest.h>

#include "tests/support/bsdf_cases.h"
#include "tests/support/sampled_albedo.h"

namespace braid::test_bsdf_multi_scatter {

using namespace test;

// Toward the camera; walks from lights carry the factor of the other direction.
TEST_CASE("bsdf: multiple scattering adds no more than was lost, whatever the layers") {
  Rng rng(11);
  for (const float r : {0.05f, 0.3f, 0.6f, 1.0f}) {
    std::vector<BsdfCase> cases;
    const auto add = [&](const std::string& name, SurfaceParameters p) {
      p.baseColor = Spectrum(1);
      cases.push_back({name + " " + std::to_string(r), withMultiScatter(p)});
    };
    for (const bool entering : {true, false}) {
      for (const float t : {0.5f, 1.0f}) add("glass", glass(r, entering, 1.5f, t));
      for (const float ior : {1.1f, 2.4f, 0.7f}) add("solid " + std::to_string(ior), glass(r, entering, ior));
      add("filmed glass", withFilm(glass(r, entering), 500));
      add("coated glass", withClearcoat(withSheen(glass(r, entering), r, Spectrum(1)), r));
      SurfaceParameters half = glass(r, entering);
      half.metallic = 0.5f;
      add("half metal, half glass", half);
    }
    add("thin", withDiffuseTransmission(thinGlass(r, 0.5f), 0.5f));
    add("brushed glass", withAnisotropy(glass(r, true), 0.7f, 0.3f));
    for (const BsdfCase& c : cases)
      for (const float z : {1.0f, 0.7f, 0.4f, 0.15f}) {
        const Bsdf bsdf(c.p, Vec3(0.6f * std::sqrt(1 - z * z), 0.8f * std::sqrt(1 - z * z), z));
        const Albedo a = radianceAlbedo(bsdf, 100, rng);
        INFO(c.name << " wo.z " << z);
        CHECK(a.mean.y < 1.012 + 4.5 * a.error.y);
        CHECK(a.largestWeight < 25);
      }
  }
}

// Within solids total reflection begins abruptly, which tables follow less well.
TEST_CASE("bsdf: with multiple scattering white metals and white glass return all light, within 0.5 %") {
  struct Case {
    std::string name;
    SurfaceParameters p;
    double allowed;
  };
  std::vector<Case> cases;
  for (const float r : {0.1f, 0.2f, 0.35f, 0.5f, 0.65f, 0.8f, 0.9f, 0.975f, 1.0f}) {
    const std::string at = " " + std::to_string(r).substr(0, 5);
    cases.push_back({"metal" + at, metal(r), 0.005});
    cases.push_back({"thin glass" + at, thinGlass(r), 0.005});
    for (const bool entering : {true, false})
      for (const float ior : {1.33f, 1.5f, 2.0f})
        cases.push_back({(entering ? "glass entering " : "glass leaving ") + std::to_string(ior) + at,
                         glass(r, entering, ior), entering ? 0.005 : 0.01});
  }
  double most[2] = {0, 0}, without = 0;
  for (Case& c : cases) {
    c.p.baseColor = Spectrum(1);
    const SurfaceParameters whole = withMultiScatter(c.p);
    for (const float z : {1.0f, 0.8f, 0.6f, 0.4f, 0.2f}) {
      const Vec3 wo(0.6f * std::sqrt(1 - z * z), 0.8f * std::sqrt(1 - z * z), z);
      const double albedo = latticeAlbedo(Bsdf(whole, wo), 30000), off = std::fabs(albedo - 1);
      INFO(c.name << " wo.z " << z << " albedo " << albedo);
      // The lattice is off by 0.05 % at most.
      CHECK(off < c.allowed + 5e-4);
      double& largest = most[c.allowed > 0.005 ? 1 : 0];
      largest = std::max(largest, off);
      without = std::max(without, 1 - latticeAlbedo(Bsdf(c.p, wo), 1000));
    }
  }
  MESSAGE("largest difference from 1: ", most[0], ", within solids ", most[1], "; by single scattering ", without);
  CHECK(without > 0.2);
}

}  // namespace braid::test_bsdf_multi_scatter
