// SPDX-License-Identifier: Apache-2.0
// The thin lens: points, rays and their densities, circles of confusion, and all integrators that see through it.
#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "tests/support/command_line.h"
#include "tests/support/render_fixture.h"
#include "tests/support/statistics/seed_means.h"

namespace braid::test_lens {

using namespace test;

namespace {

constexpr int kWidth = 48, kHeight = 32;

CameraData lensCamera(float radius, float focus) {
  CameraData camera = cameraAt({0.3f, -0.2f, 2}, {0.1f, 0.4f, -1});
  camera.lensRadius = radius;
  camera.focusDistance = focus;
  return camera;
}

// p of Pearson's test that all of these cells are equally probable.
double pUniform(const std::vector<double>& counts) {
  double total = 0, chi = 0;
  for (const double n : counts) total += n;
  const double expected = total / static_cast<double>(counts.size());
  for (const double n : counts) chi += sqr(n - expected) / expected;
  return gammaQ(0.5 * static_cast<double>(counts.size() - 1), 0.5 * chi);
}

// A box in whose foreground a sphere is much out of focus.
SceneData blurredBox(float lensRadius) {
  SceneData data = cornellBox();
  TriangleMesh sphere;
  addSphere(sphere, {-0.25f, 0.2f, 1.2f}, 0.3f, 3);
  Material red = data.materials[0];
  red.emission = Spectrum(0);
  red.baseColor = Spectrum(0.8f, 0.2f, 0.1f);
  data.materials.push_back(red);
  addMesh(data, std::move(sphere), static_cast<uint32_t>(data.materials.size() - 1));
  data.cameras[0].lensRadius = lensRadius;
  data.cameras[0].focusDistance = glm::length(Vec3(data.cameras[0].toWorld[3]));
  return data;
}

const SeedMeans kMeans{36, 6, 16};

}  // namespace

TEST_CASE("Lens: its points are uniform on the disk, and rays meet in the plane of focus") {
  const float radius = 0.2f, focus = 1.7f;
  const Camera camera(lensCamera(radius, focus), kWidth, kHeight);
  const Mat4 toCamera = camera.worldToCamera();
  Rng rng(3);
  std::vector<double> cells(8 * 16);
  for (int i = 0; i < 100'000; ++i) {
    const Vec3 p(toCamera * Vec4(camera.lensPoint(rng.next2()), 1));
    const float r2 = (p.x * p.x + p.y * p.y) / (radius * radius);
    REQUIRE(r2 < 1.0001f);
    REQUIRE(std::fabs(p.z) < 1e-6f);
    const float turn = std::atan2(p.y, p.x) / (2 * kPi) + 0.5f;
    const auto ring = std::min<size_t>(7, static_cast<size_t>(8 * r2)), sector = static_cast<size_t>(16 * turn) % 16;
    ++cells[16 * ring + sector];
  }
  CHECK(pUniform(cells) > 1e-4);  // by chance once in 10,000 seeds
  for (int i = 0; i < 1000; ++i) {
    const Vec2 raster = rng.next2() * Vec2(kWidth, kHeight);
    const Vec3 lens = camera.lensPoint(rng.next2());
    const Camera::CameraRay centre = camera.ray(raster), ray = camera.rayFrom(lens, raster);
    const auto atFocus = [&](const Camera::CameraRay& r) {
      return r.origin + r.direction * (focus / glm::dot(r.direction, camera.forward()));
    };
    CHECK(glm::length(atFocus(centre) - atFocus(ray)) < 1e-5f);
    // And back, from anywhere on the ray.
    const std::optional<Vec2> back = camera.projectFrom(lens, ray.origin + ray.direction * (0.2f + 5 * rng.next()));
    REQUIRE(back);
    CHECK(glm::length(*back - raster) < 2e-3f);
  }
  CHECK_FALSE(camera.projectFrom(camera.position(), camera.position() - camera.forward()));
}

TEST_CASE("Lens: from each of its points rays have the density that is claimed") {
  const Camera camera(lensCamera(0.3f, 1.2f), kWidth, kHeight);
  Rng rng(4);
  for (int i = 0; i < 4; ++i) {
    const Vec3 lens = camera.lensPoint(rng.next2());
    // Over the whole frame: all pixels' rays.
    const auto sample = [&](Rng& r) -> std::optional<Vec3> {
      return camera.rayFrom(lens, r.next2() * Vec2(kWidth, kHeight)).direction;
    };
    const auto pdf = [&](const Vec3& d) {
      const std::optional<Vec2> raster = camera.projectFrom(lens, lens + d);
      const bool inside = raster && raster->x >= 0 && raster->x < kWidth && raster->y >= 0 && raster->y < kHeight;
      return inside ? camera.pixelPdf(d) / (kWidth * kHeight) : 0.0;
    };
    double integral = 0;  // of the density, by uniform directions
    const int count = 400'000;
    for (int k = 0; k < count; ++k) integral += pdf(squareToUniformSphere(rng.next2())) * 4 * 3.14159265 / count;
    CHECK(integral == doctest::Approx(1).epsilon(0.03));
    // Cells of the frame on the plane of focus are equally probable; the density must say so of each.
    std::vector<double> observed(16), claimed(16);
    for (int k = 0; k < 100'000; ++k) {
      const std::optional<Vec2> raster = camera.projectFrom(lens, lens + *sample(rng));
      REQUIRE(raster);
      const auto cell = [](float v, float n) { return std::clamp(static_cast<int>(4 * v / n), 0, 3); };
      ++observed[static_cast<size_t>(4 * cell(raster->y, kHeight) + cell(raster->x, kWidth))];
      const Vec3 d = squareToUniformSphere(rng.next2());
      if (const double p = pdf(d); p > 0) {
        const Vec2 at = *camera.projectFrom(lens, lens + d);
        claimed[static_cast<size_t>(4 * cell(at.y, kHeight) + cell(at.x, kWidth))] += p * 4 * 3.14159265 / 100'000;
      }
    }
    CHECK(pUniform(observed) > 1e-4);
    for (const double share : claimed) CHECK(share == doctest::Approx(1.0 / 16).epsilon(0.12));
  }
}

TEST_CASE("Lens: the circle of confusion of a far and of a near point is that of the closed form") {
  for (const float depth : {1.2f, 2.0f, 5.0f}) {
    const float radius = 0.3f, focus = 2, half = 0.008f * depth;
    SceneData data;
    data.materials.push_back(diffuseMaterial(Spectrum(0), Spectrum(1000)));
    TriangleMesh lamp;
    addQuad(lamp, {-half, -half, -depth}, {2 * half, 0, 0}, {0, 2 * half, 0});
    addMesh(data, std::move(lamp), 0);
    CameraData camera;
    camera.yfov = 0.5f;
    camera.lensRadius = radius;
    camera.focusDistance = focus;
    data.cameras = {camera};
    Settings settings = settingsFor(64, 64, 2048);
    settings.maxDepth = 1;
    const RenderResult r = render(std::move(data), settings);
    double sum = 0, moment = 0;
    for (int y = 0; y < 64; ++y)
      for (int x = 0; x < 64; ++x) {
        const double value = static_cast<double>(r.image[1].at(x, y));
        sum += value;
        moment += value * (sqr(x + 0.5 - 32) + sqr(y + 0.5 - 32));
      }
    // A disk of radius R has the second moment R² / 2, a square a² / 6, which pixels have less.
    const double pixelsPerTangent = 32 / std::tan(0.25), side = 2 * 0.008 * pixelsPerTangent;
    const double confusion =
        static_cast<double>(radius * std::fabs(depth - focus) / (depth * focus)) * pixelsPerTangent;
    const double expected = 0.5 * sqr(confusion) + (sqr(side) - 1) / 6;
    REQUIRE(sum > 0);
    MESSAGE("depth ", depth, ": circle of ", confusion, " pixels, second moment over expected ",
            moment / sum / expected);
    CHECK(moment / sum == doctest::Approx(expected).epsilon(0.02).scale(confusion > 0 ? 0 : 10));
  }
}

// Student's t of 15 degrees of freedom and more exceeds 7 once in 200,000: over 36 blocks and 5 integrators a false
// alarm in 1,000 choices of seeds. Photons and merging blur: 2 % are forgiven there.
TEST_CASE("Lens: all integrators see the same blurred box") {
  const Scene scene(blurredBox(0.25f)), sharp(blurredBox(0));
  const std::vector<Measured> pt = blockMeans(kMeans, scene, "pt", 64, 1000);
  // The test would see a pinhole: the largest difference.
  CHECK(worst(blockMeans(kMeans, sharp, "pt", 64, 2000), pt, 0) > 20);
  const std::tuple<const char*, uint64_t, double> others[] = {
      {"bdpt", 16, 0.0}, {"crn", 64, 0.0}, {"gdpt", 32, 0.0}, {"vcm", 16, 0.02}, {"sppm", 32, 0.02}};
  for (const auto& [name, spp, bias] : others) {
    const double z = worst(blockMeans(kMeans, scene, name, spp, 1), pt, bias);
    MESSAGE(std::string(name), ": largest difference from pt ", z, " standard errors");
    CHECK(z < 7);
  }
}

TEST_CASE("Lens: bdpt equals pt pixel by pixel, also by light paths alone, with every filter") {
  const Scene scene(blurredBox(0.12f));
  for (const PixelFilter filter : {PixelFilter::Box, PixelFilter::Gaussian}) {
    Settings settings = settingsFor(48, 48, 128);
    settings.filter = filter;
    settings.integrators = {"bdpt"};
    const RenderResult bdpt = render(scene, settings);
    settings.integrators = {"pt"};
    settings.seed = 77;
    settings.spp = 512;
    CHECK(disagreement(bdpt, render(scene, settings), 16) < 1);  // false alarm 10⁻⁴
  }
}

TEST_CASE("--aperture and --focus: metres, f-numbers, pixels; what they cannot do is said") {
  const Folder folder;
  const std::string render = "render '" BRAID_SOURCE_DIR
                             "/scenes/cornell.glb' --size 32x24 --spp 4 --integrator pt "
                             "--combine none -o o.exr --reproducible ";
  const auto attribute = [&](const std::string& name) {
    for (const Attribute& a : readImage(folder.path / "o.exr").attributes)
      if (a.name == name) return a.number;
    return 0.0;
  };
  REQUIRE(braidRun(folder, render + "--look-at 0,1,4,0,1,0 --yfov 40 --aperture 0.1 --focus 2.5").code == 0);
  CHECK(attribute("braid/lensDiameter") == doctest::Approx(0.1));
  CHECK(attribute("focus") == doctest::Approx(2.5));
  // 24 mm / (2 tan 20°) = 33 mm, of which f/2 is the half.
  REQUIRE(braidRun(folder, render + "--look-at 0,1,4,0,1,0 --yfov 40 --aperture f/2 --focus 16,12").code == 0);
  CHECK(attribute("braid/lensDiameter") == doctest::Approx(0.5 * 0.012 / std::tan(0.349066)).epsilon(1e-4));
  CHECK(attribute("focus") > 1);
  CHECK(braidRun(folder, render + "--focus 2").code == 1);
  CHECK(braidRun(folder, render + "--aperture f/0").code == 1);
  CHECK(braidRun(folder, render + "--aperture wide").code == 1);
  const test::Run nothing = braidRun(folder, render + "--look-at 0,1,4,0,9,40 --aperture f/2");
  CHECK(nothing.code == 1);
  CHECK(contains(nothing.err, "sees nothing"));
}

}  // namespace braid::test_lens
