// SPDX-License-Identifier: Apache-2.0
// The ground of --ground: as bright as its backdrop where nothing shadows it, an ordinary floor elsewhere, and shadows
// with the right alpha.
#include <algorithm>

#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "renderer/scene/data/ground.h"
#include "renderer/scene/data/scene_defaults.h"
#include "tests/support/command_line.h"
#include "tests/support/render_fixture.h"

namespace braid::test_ground {

using namespace test;

namespace {

constexpr int kWidth = 48, kHeight = 32, kBlock = 8, kBlocks = kWidth * kHeight / sqr(kBlock), kSeeds = 16;

// A red ball above nothing.
SceneData ball() {
  SceneData data;
  data.materials.push_back(diffuseMaterial({0.7f, 0.2f, 0.1f}));
  TriangleMesh mesh;
  addSphere(mesh, {0, 0.5f, 0}, 0.5f, 3);
  addMesh(data, std::move(mesh), 0);
  data.cameras = {cameraAt({1.2f, 2.0f, 3.2f}, {0, 0.3f, 0})};
  return data;
}

SceneData lit(DefaultLight light, bool sun) {
  SceneData data = ball();
  giveDefaultLight(data, light);
  if (sun) {
    PunctualLight l;
    l.kind = PunctualKind::Directional;
    l.direction = glm::normalize(Vec3(1, -1, -0.5f));
    l.intensity = Spectrum(2);
    data.lights = {l};
  }
  return data;
}

// Block means of one channel over seeds.
template <class Image>
std::vector<Measured> blockMeans(uint64_t firstSeed, const Image& imageOf) {
  std::vector<double> sum(kBlocks), squares(kBlocks);
  for (uint64_t k = 0; k < kSeeds; ++k) {
    const Plane<float> image = imageOf(firstSeed + k);
    size_t b = 0;
    for (int y = 0; y < kHeight; y += kBlock)
      for (int x = 0; x < kWidth; x += kBlock, ++b) {
        double mean = 0;
        for (int i = 0; i < sqr(kBlock); ++i)
          mean += static_cast<double>(image.at(x + i % kBlock, y + i / kBlock)) / sqr(kBlock);
        sum[b] += mean / kSeeds;
        squares[b] += sqr(mean) / kSeeds;
      }
  }
  std::vector<Measured> means;
  for (size_t b = 0; b < kBlocks; ++b)
    means.push_back({sum[b], std::sqrt(std::max(0.0, squares[b] - sqr(sum[b])) / (kSeeds - 1))});
  return means;
}

// In standard errors, rounding forgiven.
double worst(const std::vector<Measured>& a, const std::vector<Measured>& b) {
  double z = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const double distance = std::fabs(a[i].value - b[i].value) - kRounding * b[i].value;
    if (distance > 0) z = std::max(z, distance / std::hypot(a[i].error, b[i].error));
  }
  return z;
}

RenderResult rendered(const Scene& scene, uint64_t seed, bool transparent, const char* integrator = "pt") {
  Settings settings = settingsFor(kWidth, kHeight, 32);
  settings.seed = seed;
  settings.transparent = transparent;
  settings.integrators = {integrator};
  return render(scene, settings);
}

}  // namespace

TEST_CASE("Ground: its open radiance is that of half-white paper under the sky and the sun") {
  CHECK(average(openGroundRadiance(lit(DefaultLight::Dome, false))) == doctest::Approx(0.25));
  const double sun = 0.5 * 2 * (1 / 1.5) / 3.14159265;  // albedo · E · cosine / π
  CHECK(average(openGroundRadiance(lit(DefaultLight::Dome, true))) == doctest::Approx(0.25 + sun).epsilon(1e-4));
  // The studio's, against its own quadrature by random directions.
  const SceneData studio = lit(DefaultLight::Studio, false);
  const Environment environment(*studio.environment);
  Rng rng(11);
  double sum = 0;
  for (int i = 0; i < 200'000; ++i) {
    const Vec3 d = squareToUniformSphere(rng.next2());
    if (d.y > 0) sum += static_cast<double>(average(environment.radiance(d)) * d.y);
  }
  CHECK(average(openGroundRadiance(studio)) == doctest::Approx(0.5 * 4 * sum / 200'000).epsilon(0.01));
  CHECK(*studio.backdrop == openGroundRadiance(studio));
}

// Student's t of 15 degrees of freedom exceeds 7 in either direction once in 200,000; 24 blocks.
TEST_CASE("Ground: open, it cannot be told from the backdrop; shadowed, it is a real floor") {
  for (const DefaultLight light : {DefaultLight::Dome, DefaultLight::Studio}) {
    SceneData data = lit(light, true);
    addGround(data);
    // The same with a floor that reaches twice as far, made by hand.
    SceneData real = lit(light, true);
    real.materials.push_back(diffuseMaterial(Spectrum(0.5f)));
    TriangleMesh floor;
    const float y = data.meshes.back().positions[0].y;
    addQuad(floor, {-30, y, 30}, {60, 0, 0}, {0, 0, -60});
    addMesh(real, std::move(floor), 1);
    real.backdrop = data.backdrop;
    const Scene ground(std::move(data)), expected(std::move(real));
    const auto green = [&](const Scene& scene, const char* integrator) {
      return [&scene, integrator](uint64_t seed) { return rendered(scene, seed, false, integrator).image[1]; };
    };
    const std::vector<Measured> b = blockMeans(100, green(expected, "pt"));
    for (const char* integrator : {"pt", "bdpt"}) {
      const std::vector<Measured> a = blockMeans(1, green(ground, integrator));
      CAPTURE(std::string(integrator));
      CHECK(worst(a, b) < 7);
      // The upper corners show open ground or what is behind it.
      const double backdrop = static_cast<double>(ground.data().backdrop->y);
      CHECK(a[0].value == doctest::Approx(backdrop).epsilon(0.02));
      CHECK(a[kWidth / kBlock - 1].value == doctest::Approx(backdrop).epsilon(0.02));
    }
  }
}

TEST_CASE("Ground: with alpha, the picture over the backdrop is the picture without, in the mean of the channels") {
  SceneData data = lit(DefaultLight::Studio, true);
  addGround(data);
  const float open = average(*data.ground);
  const Scene scene(std::move(data));
  const auto grey = [](const RenderResult& r) {
    Plane<float> image(kWidth, kHeight);
    for (size_t i = 0; i < image.size(); ++i) image[i] = average(Spectrum(r.image.pixel(i)));
    return image;
  };
  const auto over = [&](uint64_t seed) {
    const RenderResult r = rendered(scene, seed, true);
    REQUIRE(r.alpha);
    Plane<float> image = grey(r);
    for (size_t i = 0; i < image.size(); ++i) image[i] += (1 - (*r.alpha)[i]) * open;
    return image;
  };
  const auto opaque = [&](uint64_t seed) { return grey(rendered(scene, seed, false)); };
  const double z = worst(blockMeans(1, over), blockMeans(100, opaque));
  MESSAGE("largest difference ", z, " standard errors");
  CHECK(z < 7);
  // Shadows are black and partly opaque; far from the ball nothing is left.
  const RenderResult r = rendered(scene, 1, true);
  double most = 0;
  for (size_t i = 0; i < r.alpha->size(); ++i) {
    if (r.image[0][i] > 0) continue;
    most = std::max(most, static_cast<double>((*r.alpha)[i]));
  }
  CHECK(most > 0.4);
  CHECK(std::fabs(r.alpha->at(0, 0)) < 0.15f);
}

namespace {

// A scene with caustics, lit by lamps and by an image that the folder is given.
std::string sceneUnderSky(const Folder& folder) {
  const std::string scenes = "'" BRAID_SOURCE_DIR "/scenes/";
  REQUIRE(braidRun(folder, "render " + scenes + "sun_sky.glb' -q --size 8x4 --spp 1 --combine none -o sky.exr").code ==
          0);
  return scenes + "torus_glass.glb' --env sky.exr --env-scale 0.01 --size 32x18 --spp 2 --ground ";
}

}  // namespace

TEST_CASE("--ground --transparent: auto takes what has an alpha of shadows, and the plan says so") {
  const Folder folder;
  const std::string scene = sceneUnderSky(folder);
  const std::string opaque = braidRun(folder, "plan " + scene).out;
  CHECK(contains(opaque, "+ ground: under the scene"));
  CHECK(contains(opaque, "+ sppm: "));
  for (const char* more : {"--transparent", "--transparent --full"}) {
    const std::string plan = braidRun(folder, "plan " + scene + more).out;
    CHECK(contains(plan, "+ pt: its paths know the alpha of shadows"));
    for (const char* left : {"bdpt", "sppm", "gdpt", "vcm"})
      CHECK(contains(plan, std::string("- ") + left + ": has no alpha of shadows (--ground --transparent)"));
  }
  const std::string render = "render " + scene + "-q --transparent --combine none -o ";
  REQUIRE(braidRun(folder, render + "auto.exr --integrator auto").code == 0);
  REQUIRE(braidRun(folder, render + "pt.exr --integrator pt").code == 0);
  CHECK(readImage(folder.path / "auto.exr").planes.at("A").data ==
        readImage(folder.path / "pt.exr").planes.at("A").data);
}

TEST_CASE("--ground --transparent: what has no alpha of shadows is refused in one line") {
  const Folder folder;
  const std::string scene = sceneUnderSky(folder);
  const auto refusal = [&](const std::string& arguments) {
    const test::Run run = braidRun(folder, "render " + arguments + " --transparent -o o.exr");
    CHECK(run.code == 1);
    CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 1);
    return run.err;
  };
  for (const std::string integrator : {"bdpt", "sppm", "gdpt", "vcm", "auto,sppm"})
    CHECK(contains(refusal(scene + "--integrator " + integrator),
                   "has no alpha of shadows: use --integrator auto or pt"));
  CHECK(contains(refusal("'" BRAID_SOURCE_DIR "/scenes/materials.glb' --spp 1 --ground"), "give --env"));
}

}  // namespace braid::test_ground
