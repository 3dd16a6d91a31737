// SPDX-License-Identifier: Apache-2.0
// Panes, that is thin, smooth, clear surfaces, are crossed straight on by paths and by shadow rays.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/transport/visibility.h"
#include "tests/support/bsdf_cases.h"
#include "tests/support/statistics/chi_squared.h"
#include "tests/transport/media/panes.h"

namespace braid::test_panes_transmission {

using namespace test;
using namespace test::panes;

namespace {

Spectrum straightBySampling(const Bsdf& bsdf, bool& nonStraightToo) {
  Spectrum sum(0);
  Rng rng(3);
  for (int i = 0; i < 64; ++i) {
    BsdfSample s;
    if (!bsdf.sample((static_cast<float>(i) + 0.5f) / 64, rng.next2(), s)) continue;
    if (s.straight)
      sum = s.weight * s.pdfW;
    else
      nonStraightToo = true;
  }
  return sum;
}

// Panes at z = 1, 2 and 3, a wall at z = 4 with a hole.
SceneData panesAndWall() {
  SceneData data;
  data.materials = {pane({0.5f, 1, 1}), pane({1, 0.5f, 1}, 0, 0.5f), pane(Spectrum(1), 0.2f),
                    diffuseMaterial(Spectrum(0.5f))};
  const auto quad = [&](const Vec3& p, uint32_t material, float size = 2) {
    TriangleMesh mesh;
    addQuad(mesh, p, {size, 0, 0}, {0, size, 0});
    addMesh(data, std::move(mesh), material);
  };
  quad({-1, -1, 1}, 0);
  quad({-1, -1, 2}, 1);
  quad({-1, -1, 3}, 2, 1);  // frosted, over a quarter
  quad({0, 0, 4}, 3, 1);    // a wall over another
  data.cameras.push_back(CameraData{});
  data.environment = EnvironmentData{nullptr, Spectrum(1), 0};
  return data;
}

}  // namespace

TEST_CASE("What a pane lets straight through is the transmission of its BSDF, the same from both sides") {
  std::vector<BsdfCase> panes{{"clear", thinGlass(0)}, {"half", thinGlass(0, 0.5f)}, {"smoothish", thinGlass(0.03f)}};
  panes.push_back({"coated", withClearcoat(thinGlass(0, 0.8f), 0.2f)});
  BsdfCase metallic{"part metal", thinGlass(0)};
  metallic.p.metallic = 0.3f;
  panes.push_back(metallic);
  BsdfCase soapy{"film", thinGlass(0)};
  soapy.p.lobes |= kLobeIridescence;
  soapy.p.iridescence = 1;
  panes.push_back(soapy);
  BsdfCase cloth{"under sheen", thinGlass(0)};
  cloth.p.lobes |= kLobeSheen;
  cloth.p.sheenColor = Spectrum(0.5f, 0.3f, 0.4f);
  cloth.p.sheenRoughness = 0.4f;
  panes.push_back(cloth);
  for (const BsdfCase& c : panes) {
    CAPTURE(c.name);
    for (const float cosine : {1.0f, 0.7f, 0.2f}) {
      const Vec3 wo(std::sqrt(1 - sqr(cosine)), 0, cosine);
      SurfaceParameters behind = c.p;
      behind.entering = !behind.entering;
      const Bsdf front(c.p, wo), back(behind, wo), light(c.p, wo, Transport::Power);
      bool others = false;
      const Spectrum t = front.straightTransmittance(), sampled = straightBySampling(front, others);
      CHECK(front.passesStraight());
      CHECK(maxComponent(t) > 0);
      CHECK(maxComponent(t) < 1);
      CHECK(others);
      for (int k = 0; k < 3; ++k) {
        CHECK(t[k] == doctest::Approx(sampled[k]).epsilon(1e-5));
        CHECK(back.straightTransmittance()[k] == t[k]);
        CHECK(light.straightTransmittance()[k] == t[k]);
      }
    }
  }
  const Vec3 wo(0.6f, 0, 0.8f);
  for (const SurfaceParameters& p : {thinGlass(0.04f), thinGlass(0.5f), glass(0, true), glass(0, true, 1), metal(0),
                                     lambert(), plastic(0), thinGlass(0, 0)}) {
    CHECK(!Bsdf(p, wo).passesStraight());
    CHECK(isBlack(Bsdf(p, wo).straightTransmittance()));
  }
}

TEST_CASE("A clear pane takes 4 % of light that falls straight on it, as Schlick's formula says") {
  CHECK(Bsdf(thinGlass(0), Vec3(0, 0, 1)).straightTransmittance()[2] == doctest::Approx(0.96f));
}

TEST_CASE("Shadow rays are multiplied by every pane between their ends, once, and end at anything else") {
  const Scene scene(panesAndWall());
  CHECK(scene.traits().has(kTraitPanes));
  const TransportContext context(scene);
  VisibilityBatch rays(context);
  const Vec3 clear(0.5f, -0.5f, 0), frosted(-0.5f, -0.5f, 0), walled(0.5f, 0.5f, 0), up(0, 0, 1);
  const auto expected = [&](int passed) {
    Spectrum t(1);
    if (passed > 0) t *= Spectrum(0.5f, 1, 1) * 0.96f;
    if (passed > 1) t *= Spectrum(1, 0.5f, 1) * (0.5f * 0.96f);
    return t;
  };
  struct Case {
    RayQuery ray;
    bool hidden;
    int passed;
  };
  const Vec3 far(0, 0, 10);
  const std::vector<Case> cases{
      {{clear, up, kInfinity, 0}, false, 2},    {{clear, up, 1.5f, 0}, false, 1},
      {{clear, up * 2.0f, 0.75f, 0}, false, 1}, {{clear, up, 0.9f, 0}, false, 0},
      {{clear, far, 1, 0}, false, 2},           {{clear + far, -far, 1, kCameraRay}, false, 2},
      {{frosted, up, kInfinity, 0}, true, 0},   {{frosted, up, 2.5f, 0}, false, 2},
      {{walled, up, kInfinity, 0}, true, 0},    {{walled, up, 3.5f, 0}, false, 2},
      {{walled + far, -far, 1, 0}, true, 0}};
  int i = 0;
  for (const Case& c : cases) rays.set(i++, c.ray, 1);
  rays.trace(i);
  for (int k = 0; k < i; ++k) {
    CAPTURE(k);
    const Case& c = cases[static_cast<size_t>(k)];
    CHECK(rays.hidden(k) == c.hidden);
    Spectrum value(1);
    rays.attenuate(k, value);
    for (int ch = 0; ch < 3 && !c.hidden; ++ch)
      CHECK(value[ch] == doctest::Approx(expected(c.passed)[ch]).epsilon(1e-5));
  }
  i = 0;
  for (const Case& c : cases) rays.set(i++, c.ray, 1);
  rays.traceOpaque(i);
  for (int k = 0; k < i; ++k)
    CHECK(rays.hidden(k) == (cases[static_cast<size_t>(k)].hidden || cases[static_cast<size_t>(k)].passed > 0));
}

}  // namespace braid::test_panes_transmission
