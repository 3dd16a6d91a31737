// SPDX-License-Identifier: Apache-2.0
// Path tracing with common random numbers: right in the mean, the same in all pixels, independent from pass to pass,
// with a variance that is true, and quiet where neighbouring pixels are compared.
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/scene/data/gltf.h"
#include "tests/support/statistics/pass_means.h"

namespace braid::test_crn {

using namespace test;

namespace {

// A matt wall under a uniform sky, seen at right angles by an orthographic camera: every pixel is the same.
SceneData uniformWall() {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.5f, 0.6f, 0.7f))};
  TriangleMesh wall;
  addQuad(wall, {-100, -100, 0}, {200, 0, 0}, {0, 200, 0});
  addMesh(data, std::move(wall), 0);
  data.environment = EnvironmentData{nullptr, Spectrum(1, 2, 3), 0};
  PunctualLight sun;
  sun.kind = PunctualKind::Directional;
  sun.intensity = Spectrum(1);
  sun.direction = glm::normalize(Vec3(0.3f, -0.4f, -1));
  data.lights.push_back(sun);
  data.cameras.push_back(spotCamera({0, 0, 4}, {0, 0, 0}, 1));
  return data;
}

// Σ over pixels and channels of the squared difference of an image's neighbours, its expectation removed.
double differenceNoise(const Rgb<float>& image, const Rgb<float>& expected) {
  double sum = 0;
  const auto error = [&](size_t c, int x, int y) {
    return static_cast<double>(image[c].at(x, y)) - static_cast<double>(expected[c].at(x, y));
  };
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < image.height(); ++y)
      for (int x = 0; x + 1 < image.width(); ++x) sum += sqr(error(c, x + 1, y) - error(c, x, y));
  return sum;
}

}  // namespace

TEST_CASE("crn: the mean is the path tracer's") {
  const Scene box(cornellBox());
  CHECK(disagreement(passMeans(box, settingsOf("crn", 12, 12, 2000, 1), 4),
                     passMeans(box, settingsOf("pt", 12, 12, 2000, 2), 4)) < 1);
  const Scene plates(loadGltf(sourcePath("scenes/plates.glb")));
  Settings crn = settingsOf("crn", 12, 8, 1500, 1), pt = settingsOf("pt", 12, 8, 1500, 2);
  crn.clamp = pt.clamp = 4;
  const std::vector<Measured> expected = passMeans(plates, pt, 4);
  CHECK(disagreement(passMeans(plates, crn, 4), expected) < 1);
  // Another expectation is told apart.
  crn.clamp = 0.5f;
  CHECK(disagreement(passMeans(plates, crn, 4), expected) > 1);
}

TEST_CASE("crn: pixels with the same view get the same sample in every pass") {
  const Scene scene(uniformWall());
  for (uint64_t spp = 1; spp <= 4; ++spp) {
    const RenderResult crn = render(scene, settingsOf("crn", 9, 7, spp)),
                       pt = render(scene, settingsOf("pt", 9, 7, spp));
    const auto spread = [](const Rgb<float>& image, size_t c) {
      const auto [lo, hi] = std::minmax_element(image[c].data.begin(), image[c].data.end());
      return *hi - *lo;
    };
    for (size_t c = 0; c < 3; ++c) {
      // Directions are computed from hit points: only rounding differs.
      CHECK(spread(crn.image, c) < 2e-5f * crn.image[c][0]);
      CHECK(spread(pt.image, c) > 1e-2f * pt.image[c][0]);
    }
  }
  // But not in the next pass, nor with another seed.
  const float first = render(scene, settingsOf("crn", 1, 1, 1)).image[0][0];
  CHECK(std::fabs(render(scene, settingsOf("crn", 1, 1, 2)).image[0][0] - first) > 1e-3f * first);
  CHECK(std::fabs(render(scene, settingsOf("crn", 1, 1, 1, 1)).image[0][0] - first) > 1e-3f * first);
}

TEST_CASE("crn: a crop is that region of the full frame") {
  const Scene scene(cornellBox());
  Settings settings = settingsOf("crn", 20, 16, 3);
  const Rgb<float> full = render(scene, settings).image;
  settings.crop = PixelWindow{5, 3, 18, 9};
  const Rgb<float> crop = render(scene, settings).image;
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < crop.height(); ++y)
      for (int x = 0; x < crop.width(); ++x) CHECK(crop[c].at(x, y) == full[c].at(5 + x, 3 + y));
}

TEST_CASE("crn: quarters are independent of each other and of the path tracer") {
  const Scene scene(cornellBox());
  constexpr int kSeeds = 600;
  // Image means of the four quarters and of pt, each seed a draw of five variates.
  std::vector<std::array<double, 5>> draws;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    Settings settings = settingsOf("crn", 6, 6, 8, seed);
    settings.threads = 1;
    settings.keep.quarters = true;
    settings.clamp = 2;
    const RenderResult crn = render(scene, settings);
    settings.integrators = {"pt"};
    const RenderResult pt = render(scene, settings);
    std::array<double, 5> d{};
    for (size_t k = 0; k < 5; ++k) {
      const Rgb<float>& image = k < 4 ? estimateOf(crn).quarter[k] : pt.image;
      for (const float v : image[1].data) d[k] += static_cast<double>(v);
    }
    draws.push_back(d);
  }
  std::array<double, 5> mean{}, deviation{};
  for (size_t k = 0; k < 5; ++k) {
    for (const auto& d : draws) mean[k] += d[k] / kSeeds;
    for (const auto& d : draws) deviation[k] += sqr(d[k] - mean[k]) / kSeeds;
    deviation[k] = std::sqrt(deviation[k]);
  }
  double worst = 0;
  for (size_t a = 0; a < 5; ++a)
    for (size_t b = 0; b < a; ++b) {
      double covariance = 0;
      for (const auto& d : draws) covariance += (d[a] - mean[a]) * (d[b] - mean[b]) / kSeeds;
      worst = std::max(worst, std::fabs(covariance / (deviation[a] * deviation[b])));
    }
  // A correlation of n independent pairs has a standard error of 1/√n; ten correlations, false alarm 10⁻³.
  MESSAGE("largest correlation of two quarters, or of a quarter and pt: ", worst);
  CHECK(worst < zLimit(10, 1e-3) / std::sqrt(double(kSeeds)));
}

TEST_CASE("crn: the reported variance is true") {
  // Within a pass the pixels share their error, so that it takes seeds, not pixels, to see its variance.
  Settings settings = settingsOf("crn", 4, 4, 8);
  settings.clamp = 1;
  settings.threads = 1;
  checkCalibrated("cornell", reportedOverEmpirical(Scene(cornellBox()), settings, 2000));
  settings = settingsOf("crn", 6, 4, 8);
  settings.clamp = 1;
  settings.threads = 1;
  checkCalibrated("plates", reportedOverEmpirical(Scene(loadGltf(sourcePath("scenes/plates.glb"))), settings, 1500));
}

TEST_CASE("crn: the choice of sampler changes nothing") {
  const Scene scene(cornellBox());
  const RenderResult a = render(scene, settingsOf("crn", 8, 8, 6, 3, SamplerKind::Independent)),
                     b = render(scene, settingsOf("crn", 8, 8, 6, 3, SamplerKind::Sobol));
  CHECK(sameBits(estimateOf(a), estimateOf(b)));
  CHECK(sameBits(estimateOf(a).variance, estimateOf(b).variance));
}

TEST_CASE("crn: differences of neighbours have far less noise than the path tracer's") {
  const Scene scene(cornellBox());
  const Rgb<float> reference = render(scene, settingsOf("pt", 40, 40, 512, 77, SamplerKind::Sobol)).image;
  double noise[2] = {0, 0};
  for (uint64_t seed = 0; seed < 6; ++seed) {
    noise[0] += differenceNoise(render(scene, settingsOf("crn", 40, 40, 16, seed)).image, reference);
    noise[1] += differenceNoise(render(scene, settingsOf("pt", 40, 40, 16, seed)).image, reference);
  }
  MESSAGE("squared noise of differences, crn over pt: ", noise[0] / noise[1]);
  CHECK(noise[0] < 0.5 * noise[1]);
}

}  // namespace braid::test_crn
