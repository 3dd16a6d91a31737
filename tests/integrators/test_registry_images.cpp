// SPDX-License-Identifier: Apache-2.0
// What every registered integrator promises of its image: closed forms, agreement, transparency. A new one is covered
// by being in the registry.

#include <doctest/doctest.h>

#include "integrators/registry.h"
#include "renderer/scene/data/gltf.h"
#include "renderer/session/session.h"
#include "tests/integrators/small_renders.h"
#include "tests/support/statistics/chi_squared.h"
#include "tools/bench/builtin_scenes.h"

namespace braid::test_registry_images {

using namespace test::small_renders;

namespace {

// The mean over an image and over each of four quadrants, per channel: 15 numbers.
std::vector<double> means(const Rgb<float>& image) {
  std::vector<double> result(15, 0.0);
  const int w = image.width(), h = image.height();
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      for (size_t c = 0; c < 3; ++c) {
        const auto quadrant = static_cast<size_t>((2 * x >= w) + 2 * (2 * y >= h));
        const double v = static_cast<double>(image[c].at(x, y));
        result[c] += v / (w * h);
        result[3 + 3 * quadrant + c] += 4 * v / (w * h);
      }
  return result;
}

struct MeanAndError {
  double mean = 0, error = 0;  // error: standard deviation of the mean
};

// Every pass is an independent image with the independent sampler, whatever pixels of a pass share.
std::vector<MeanAndError> meansOfPasses(const Scene& scene, const Integrator& integrator, Settings settings, int passes,
                                        const Integrators& all) {
  settings.sampler = SamplerKind::Independent;
  const Plan plan = makePlan(scene, cameraOf(scene), settings, pointersTo(all));
  const TransportContext context(scene, settings.lightStrategy);
  PassTarget target(settings.width, settings.height, {.splats = integrator.splats(), .features = plan.kept.features});
  std::vector<double> sum(15), squares(15);
  for (int pass = 0; pass < passes; ++pass) {
    target.clear();
    REQUIRE(integrator.renderPass({context, plan, static_cast<uint64_t>(pass)}, target));
    Accumulator film(settings.width, settings.height, 2);
    film.commit(0, target);
    const std::vector<double> values = means(film.mean());
    for (size_t i = 0; i < values.size(); ++i) {
      sum[i] += values[i];
      squares[i] += values[i] * values[i];
    }
  }
  std::vector<MeanAndError> result;
  for (size_t i = 0; i < sum.size(); ++i) {
    const double mean = sum[i] / passes;
    result.push_back({mean, std::sqrt(std::max(0.0, squares[i] / passes - mean * mean) / (passes - 1))});
  }
  return result;
}

// How far the expectation of a few passes may be from the truth, relative: photons and merged vertices blur over a few
// pixels, and at corners they miss what lies around them.
double allowedBias(const Integrator& integrator) { return integrator.unbiased() ? 0.0 : 0.02; }

}  // namespace

TEST_CASE("Inside a furnace every integrator sees the closed form" * doctest::test_suite("statistics")) {
  const Integrators all = makeIntegrators();
  for (const float albedo : {0.0f, 0.5f, 0.8f}) {
    const Scene scene(furnace(albedo, 1));
    for (const auto& i : all) {
      Settings settings = smallFrame(16, 16, 1, i->name());
      settings.maxDepth = 200;
      const std::vector<MeanAndError> m = meansOfPasses(scene, *i, settings, 48, all);
      CAPTURE(std::string(i->name()));
      CAPTURE(albedo);
      // 4 standard errors by Student's t with 47 degrees of freedom: a false alarm in 4500 runs for each integrator and
      // albedo. Rounding of the mean of floats allows 10⁻⁶ more.
      const double expected = 1 / (1 - static_cast<double>(albedo));
      CHECK(std::fabs(m[0].mean - expected) <= 4 * m[0].error + (1e-6 + allowedBias(*i)) * expected);
      CHECK(m[0].error < 0.02 * expected);
    }
  }
}

TEST_CASE("Integrators agree on a Cornell box" * doctest::test_suite("statistics")) {
  constexpr double kFalseAlarm = 1e-3;  // of all comparisons together
  const Scene scene(cornellBox());
  const Integrators all = makeIntegrators();
  Settings reference = smallFrame(12, 12, 1, "pt");
  reference.seed = 1000;  // pt is compared too: with itself under another seed
  const auto pt = std::find_if(all.begin(), all.end(), [](const auto& i) { return std::string(i->name()) == "pt"; });
  REQUIRE(pt != all.end());
  const std::vector<MeanAndError> expected = meansOfPasses(scene, **pt, reference, 400, all);
  for (const auto& i : all) {
    const std::vector<MeanAndError> m = meansOfPasses(scene, *i, smallFrame(12, 12, 1, i->name()), 400, all);
    for (size_t k = 0; k < m.size(); ++k) {
      // A frame of 12 x 12 pixels has wide ones: what is merged over five of them is an eighth of the picture.
      const double bias = 4 * allowedBias(*i) * expected[k].mean;
      const double distance = std::max(0.0, std::fabs(m[k].mean - expected[k].mean) - bias);
      const double z = distance / std::hypot(m[k].error, expected[k].error);
      CAPTURE(std::string(i->name()));
      CAPTURE(k);
      CHECK(std::erfc(z / std::sqrt(2.0)) > test::sidak(kFalseAlarm, static_cast<int>(m.size() * all.size())));
    }
  }
}

TEST_CASE("Images of real scenes are finite and nowhere negative") {
  const Integrators all = makeIntegrators();
  for (const char* file : {"cornell", "materials", "glass_of_water", "plates", "sun_sky"}) {
    const Scene scene(loadGltf(std::string(BRAID_SOURCE_DIR) + "/scenes/" + file + ".glb"));
    for (const auto& i : all) {
      const RenderResult r = render(scene, smallFrame(48, 27, 4, i->name()), all);
      CAPTURE(std::string(file));
      CAPTURE(std::string(i->name()));
      CHECK(r.rejected == 0);
      CHECK(sane(r.image, i->mayBeNegative()));
      CHECK(sane(r.estimates->estimates[0].variance));
      CHECK(sane(r.estimates->features->albedo.mean));
      CHECK(means(r.image)[0] > 0);
    }
  }
}

TEST_CASE("Leaving out what a scene does not need changes no pixel") {
  const Integrators all = makeIntegrators();
  for (const char* file : {"cornell", "materials"}) {
    const std::string path = std::string(BRAID_SOURCE_DIR) + "/scenes/" + file + ".glb";
    LoadOptions everything;
    everything.keepAllAttributes = true;
    SceneOptions full;
    full.full = true;
    const Scene planned(loadGltf(path)), whole(loadGltf(path, everything), full);
    for (const auto& i : all) {
      Settings settings = smallFrame(40, 30, 4, i->name());
      const RenderResult a = render(planned, settings, all);
      settings.full = true;
      const RenderResult b = render(whole, settings, all);
      CAPTURE(std::string(file));
      CAPTURE(std::string(i->name()));
      CHECK(sameBits(a.image, b.image));
      CHECK(sameBits(a.estimates->features->albedo.mean, b.estimates->features->albedo.mean));
    }
  }
}

TEST_CASE("A transparent background gives the share of each pixel that is covered") {
  // A quad with coverage 0.3 in front of nothing fills the left half of the view.
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.5f))};
  data.materials[0].alphaMode = AlphaMode::Blend;
  data.materials[0].alpha = 0.3f;
  TriangleMesh quad;
  addQuad(quad, {-10, -10, -1}, {10, 0, 0}, {0, 20, 0});
  addMesh(data, std::move(quad), 0);
  data.environment.emplace().radiance = Spectrum(1);
  const Scene scene(std::move(data));
  const Integrators all = makeIntegrators();
  for (const auto& i : all) {
    Settings settings = smallFrame(16, 16, 256, i->name());
    CHECK_FALSE(render(scene, settings, all).alpha.has_value());
    settings.transparent = true;
    const RenderResult r = render(scene, settings, all);
    CAPTURE(std::string(i->name()));
    REQUIRE(r.alpha.has_value());
    double covered = 0;
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 16; ++x) {
        const float a = r.alpha->at(x, y);
        if (x == 8) continue;  // a ray may graze the edge of the quad
        if (x > 8) {
          CHECK(a == 0);
          CHECK(r.image.pixel(r.alpha->index(x, y)) == Vec3(0));
        } else {
          covered += static_cast<double>(a) / 128;
          CHECK((a > 0.1f && a < 0.5f));
        }
      }
    // 128 pixels × 256 samples of a coin: 4 standard deviations are 0.0101. With common random numbers all pixels of a
    // pass see the same coin: 256 samples, 0.1146.
    CHECK(std::fabs(covered - 0.3) < (i->correlation() == Correlation::CommonRandomNumbers ? 0.1146 : 0.0102));
  }
}

}  // namespace braid::test_registry_images
