// SPDX-License-Identifier: Apache-2.0
// Gradient-domain path tracing: the reconstruction inverts gradients, the shifts bias nothing whatever the surfaces
// are, the variance is true, and smooth scenes converge faster than by path tracing.
#include <cmath>

#include <doctest/doctest.h>

#include "integrators/gdpt/gdpt_kernel.h"
#include "integrators/gdpt/gdpt_poisson.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/statistics/pass_means.h"

namespace braid::test_gdpt {

using namespace test;

namespace {

// (alpha² + L) image: the right-hand side that belongs to an image whose gradients are its own.
Plane<double> applyOperator(const Plane<double>& image, double alpha) {
  Plane<double> b(image.width, image.height);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const double v = image.at(x, y);
      double sum = alpha * alpha * v;
      if (x > 0) sum += v - image.at(x - 1, y);
      if (y > 0) sum += v - image.at(x, y - 1);
      if (x + 1 < image.width) sum += v - image.at(x + 1, y);
      if (y + 1 < image.height) sum += v - image.at(x, y + 1);
      b.at(x, y) = sum;
    }
  return b;
}

double relativeDistance(const Plane<double>& a, const Plane<double>& b) {
  double distance = 0, total = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    distance += sqr(a[i] - b[i]);
    total += sqr(b[i]);
  }
  return std::sqrt(distance / total);
}

void checkUnbiased(const std::string& name, const Scene& scene, int width, int height, uint64_t passes, int block) {
  const double d = disagreement(passMeans(scene, settingsOf("gdpt", width, height, passes, 1), block),
                                passMeans(scene, settingsOf("pt", width, height, passes, 2), block));
  MESSAGE(name, ": largest z over its limit ", d);
  CHECK(d < 1);
}

// The box with blocks of a rough metal, a near-mirror and a mirror-like coat over paint, and a glass ball: every way
// to replay, reconnect or fail.
SceneData glossyBox() {
  SceneData data = cornellBox();
  Material metal;
  metal.baseColor = Spectrum(0.9f, 0.7f, 0.4f);
  metal.metallic = 1;
  metal.roughness = 0.4f;
  data.materials[0] = metal;
  Material mirror = metal;
  mirror.roughness = 0.05f;
  data.materials.push_back(mirror);
  Material coated = diffuseMaterial(Spectrum(0.6f, 0.2f, 0.1f));
  coated.specular = 1;
  coated.roughness = 0.5f;
  coated.clearcoat = 1;
  data.materials[2] = coated;
  Material glass;
  glass.metallic = 0;
  glass.roughness = 0;
  glass.transmission = 1;
  glass.thinWalled = false;
  glass.attenuationColor = Spectrum(0.3f, 0.8f, 0.9f);
  glass.attenuationDistance = 0.5f;
  data.materials.push_back(glass);
  data.meshes[1].material = static_cast<uint32_t>(data.materials.size() - 2);
  TriangleMesh ball;
  addSphere(ball, {0.4f, -0.1f, 0.4f}, 0.25f, 3);
  addMesh(data, std::move(ball), static_cast<uint32_t>(data.materials.size() - 1));
  return data;
}

// The box lined with metal of a roughness, around diffuse blocks and coloured walls that reflect most of the light:
// long paths matter. The light is dim and large: a glowing ceiling, found by sampling directions as often as by aiming.
SceneData metalBox(float roughness) {
  SceneData data = cornellBox();
  data.materials[0].baseColor = Spectrum(0.95f, 0.93f, 0.9f);
  data.materials[0].metallic = 1;
  data.materials[0].roughness = roughness;
  data.materials[1].baseColor = Spectrum(0.95f, 0.9f, 0.9f);
  data.materials[2] = data.materials[0];
  data.materials[2].baseColor = Spectrum(0.2f);
  data.materials[3].emission = Spectrum(1, 0.8f, 0.6f);
  data.meshes[1].material = 1;
  data.meshes[4] = TriangleMesh();
  addQuad(data.meshes[4], {-0.9f, 0.99f, -0.9f}, {1.8f, 0, 0}, {0, 0, 1.8f});
  data.meshes[4].material = 3;
  return data;
}

// The box behind a veil that lets half of the rays pass, under a sky.
SceneData veiledBox() {
  SceneData data = cornellBox();
  Material veil = diffuseMaterial(Spectrum(0.7f));
  veil.alphaMode = AlphaMode::Blend;
  veil.alpha = 0.5f;
  data.materials.push_back(veil);
  TriangleMesh mesh;
  addQuad(mesh, {-0.8f, -0.8f, 0.2f}, {1.2f, 0, 0.3f}, {0.1f, 1.5f, -0.3f});
  addMesh(data, std::move(mesh), static_cast<uint32_t>(data.materials.size() - 1));
  data.environment = EnvironmentData{nullptr, Spectrum(0.5f, 0.7f, 1), 0};
  return data;
}

// The mean difference of every pixel to its right neighbour, without what the camera sees directly: by the weighted
// shifts of both pixels, or by base paths that share their random numbers, which has nothing to do with shifts. Much
// sharper than a comparison of images.
std::vector<Measured> meanDifferences(const Scene& scene, int size, uint64_t passes, uint64_t seed, bool shifts) {
  const Settings settings = settingsOf("gdpt", size, size, 1);
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  const TransportContext context(scene, settings.lightStrategy);
  const auto edges = static_cast<size_t>(size * (size - 1));
  std::vector<double> sum(3 * edges), squares(3 * edges);
  for (uint64_t pass = 0; pass < passes; ++pass) {
    const PassSampler sampler(SamplerKind::Independent, seed, 1, pass);
    GradientKernel kernel(context, plan, sampler, nullptr);
    for (int i = 0; i < size * size; ++i)
      kernel.start(i % size, i / size, sampler.itemKey(shifts ? static_cast<uint64_t>(i) : 0));
    kernel.run();
    size_t k = 0;
    for (int y = 0; y < size; ++y)
      for (int x = 0; x + 1 < size; ++x) {
        const GradientSample &a = kernel.sample(y * size + x), &b = kernel.sample(y * size + x + 1);
        const Spectrum d = shifts ? a.difference[0] - b.difference[1] : b.path.radiance - a.path.radiance;
        for (int c = 0; c < 3; ++c, ++k) {
          sum[k] += static_cast<double>(d[c]);
          squares[k] += sqr(static_cast<double>(d[c]));
        }
      }
  }
  std::vector<Measured> result;
  const auto n = static_cast<double>(passes);
  for (size_t k = 0; k < sum.size(); ++k)
    result.push_back({sum[k] / n, std::sqrt(std::max(0.0, squares[k] / n - sqr(sum[k] / n)) / (n - 1))});
  return result;
}

void checkDifferences(const std::string& name, const Scene& scene, uint64_t passes) {
  constexpr int kSize = 3;
  const std::vector<Measured> shifted = meanDifferences(scene, kSize, passes, 1, true),
                              expected = meanDifferences(scene, kSize, passes, 2, false);
  const double d = disagreement(shifted, expected);
  MESSAGE(name, ": largest z over its limit ", d);
  CHECK(d < 1);
}

// Over the lower part of the box: where the light is seen, its edge holds most of the noise of either image.
double squaredError(const Rgb<float>& image, const Rgb<float>& reference) {
  double error = 0;
  for (size_t c = 0; c < 3; ++c)
    for (int y = image.height() / 3; y < image.height(); ++y)
      for (int x = 0; x < image.width(); ++x)
        error += sqr(static_cast<double>(image[c].at(x, y)) - static_cast<double>(reference[c].at(x, y)));
  return error;
}

}  // namespace

TEST_CASE("gdpt: the Poisson solver recovers an image from its own gradients") {
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 17), std::pair(33, 1), std::pair(2, 2),
                                      std::pair(37, 53), std::pair(128, 96), std::pair(257, 131)})
    for (const double alpha : {0.1, 0.2, 1.0}) {
      Plane<double> image(width, height);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          image.at(x, y) = 3 + std::sin(0.31 * x + 0.07 * y * y) + (x > width / 2 ? 5 : 0) + 0.01 * y;
      Plane<double> solution = applyOperator(image, alpha);
      solveScreenedPoisson(solution, alpha);
      CAPTURE(width);
      CAPTURE(alpha);
      CHECK(relativeDistance(solution, image) < (alpha < 0.2 ? 1e-7 : 1e-8));
    }
}

TEST_CASE("gdpt: the Poisson solver keeps the mean and is linear") {
  Plane<double> a(41, 23), b(41, 23), sum(41, 23);
  double total = 0, solved = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    a[i] = static_cast<double>(mix32(static_cast<uint32_t>(i)) % 1000);
    b[i] = static_cast<double>(mix32(static_cast<uint32_t>(i) + 7777) % 1000);
    sum[i] = 2 * a[i] - 3 * b[i];
    total += a[i];
  }
  for (Plane<double>* p : {&a, &b, &sum}) solveScreenedPoisson(*p, 0.2);
  double distance = 0, size = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    solved += a[i];
    distance += sqr(2 * a[i] - 3 * b[i] - sum[i]);
    size += sqr(sum[i]);
  }
  CHECK(0.2 * 0.2 * solved == doctest::Approx(total).epsilon(1e-8));
  CHECK(distance < 1e-20 * size);
}

// The surfaces that each path has met, the last one included.
class SurfaceCounts : public PathObserver {
 public:
  unsigned of(uint64_t key) const { return counts_.at(key); }
  void onRay(const PathState& path) override { counts_[path.key] = path.block(); }
  void onMiss() override {}
  void onHit(const Hit&) override {}
  void onLight(const ShadowRay&, bool) override {}

 private:
  std::map<uint64_t, unsigned> counts_;
};

// Before Russian roulette, which differs, the same random numbers give the same path. Panes do not count towards the
// length of a path, but roulette begins by the surfaces met.
void checkBasePath(const std::string& name, const Scene& scene) {
  Settings settings = settingsOf("gdpt", 24, 16, 1);
  settings.maxDepth = GradientKernel::kRouletteStart;
  settings.keep.features = true;
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  const TransportContext context(scene, settings.lightStrategy);
  CAPTURE(name);
  double found = 0;
  int compared = 0;
  for (uint64_t pass = 0; pass < 8; ++pass) {
    const PassSampler sampler(SamplerKind::Independent, 0, 1, pass);
    for (int y = 0; y < settings.height; ++y) {
      PathKernel path(context, plan, sampler, nullptr, {Roulette::kNever});
      GradientKernel gradient(context, plan, sampler, nullptr);
      SurfaceCounts surfaces;
      path.observe(&surfaces);
      for (int x = 0; x < settings.width; ++x) {
        const uint64_t key = sampler.itemKey(static_cast<uint64_t>(y * settings.width + x));
        path.start(x, y, key);
        gradient.start(x, y, key);
      }
      path.run();
      gradient.run();
      for (int x = 0; x < settings.width; ++x) {
        if (surfaces.of(sampler.itemKey(static_cast<uint64_t>(y * settings.width + x))) >
            GradientKernel::kRouletteStart)
          continue;
        ++compared;
        const PathSample &a = path.sample(x), &b = gradient.sample(x).path;
        const Spectrum radiance = b.radiance + gradient.sample(x).direct;
        found += static_cast<double>(average(b.radiance));
        CHECK(maxComponent(glm::abs(a.radiance - radiance)) <= 1e-5f * maxComponent(a.radiance));
        CHECK(a.coverage == b.coverage);
        CHECK(a.features.albedo == b.features.albedo);
        CHECK(a.features.depth == b.features.depth);
        CHECK(a.features.visibility == b.features.visibility);
      }
    }
  }
  CHECK(found > 0);
  const int paths = 8 * settings.width * settings.height;
  CHECK(compared >= (scene.traits().has(kTraitPanes) ? paths * 9 / 10 : paths));
}

TEST_CASE("gdpt: the base path is the path tracer's") {
  checkBasePath("glossy box", Scene(glossyBox()));
  checkBasePath("veiled box", Scene(veiledBox()));
  for (const char* name : {"materials", "torus_glass", "glass_of_water"})
    checkBasePath(name, Scene(loadGltf(sourcePath(std::string("scenes/") + name + ".glb"))));
}

TEST_CASE("gdpt: the mean is the path tracer's in a diffuse box") {
  checkUnbiased("cornell", Scene(cornellBox()), 16, 16, 1500, 2);
}

TEST_CASE("gdpt: the mean is the path tracer's among metals, coats and glass") {
  checkUnbiased("glossy box", Scene(glossyBox()), 12, 12, 1500, 4);
}

TEST_CASE("gdpt: shifted differences are those of paths with common random numbers") {
  checkDifferences("cornell", Scene(cornellBox()), 10000);
  checkDifferences("glossy box", Scene(glossyBox()), 10000);
  checkDifferences("polished metal", Scene(metalBox(0.2f)), 15000);  // replay, Russian roulette included
  checkDifferences("satin metal", Scene(metalBox(0.3f)), 15000);     // reconnected, with narrow lobes
}

TEST_CASE("gdpt: the mean is the path tracer's with coverage, a sky and textures") {
  checkUnbiased("veiled box", Scene(veiledBox()), 12, 12, 1000, 2);
  checkUnbiased("plates", Scene(loadGltf(sourcePath("scenes/plates.glb"))), 12, 8, 600, 4);
  checkUnbiased("interior", Scene(loadGltf(sourcePath("scenes/interior.glb"))), 12, 8, 600, 4);
}

TEST_CASE("gdpt: a wrong expectation is told apart") {
  const Scene scene(cornellBox());
  Settings shallow = settingsOf("gdpt", 12, 12, 600, 1);
  shallow.maxDepth = 5;
  CHECK(disagreement(passMeans(scene, shallow, 4), passMeans(scene, settingsOf("pt", 12, 12, 600, 2), 4)) > 1);
}

TEST_CASE("gdpt: less error than path tracing on a smooth scene") {
  const Scene scene(cornellBox());
  const Rgb<float> reference = render(scene, settingsOf("pt", 36, 36, 1024, 77, SamplerKind::Sobol)).image;
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
    double error[2] = {0, 0};
    for (uint64_t seed = 0; seed < 3; ++seed) {
      error[0] += squaredError(render(scene, settingsOf("gdpt", 36, 36, 16, seed, sampler)).image, reference);
      error[1] += squaredError(render(scene, settingsOf("pt", 36, 36, 16, seed, sampler)).image, reference);
    }
    MESSAGE("squared error at 16 passes, gdpt over pt: ", error[0] / error[1]);
    CHECK(error[0] < 0.2 * error[1]);
  }
}

TEST_CASE("gdpt: the reported variance is true") {
  const Scene box(cornellBox());
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
    Settings settings = settingsOf("gdpt", 6, 6, 8, 0, sampler);
    settings.clamp = 1;
    checkCalibrated(sampler == SamplerKind::Sobol ? "cornell, sobol" : "cornell, independent",
                    reportedOverEmpirical(box, settings, 1000));
  }
}

TEST_CASE("gdpt: the background is exact") {
  // A ball before a sky: pixels that see the sky only have its value to the bit, whatever happens beside them.
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.5f))};
  TriangleMesh ball;
  addSphere(ball, {0, 0, 0}, 1, 4);
  addMesh(data, std::move(ball), 0);
  data.environment = EnvironmentData{nullptr, Spectrum(0.25f, 0.5f, 1), 0};
  data.cameras.push_back(cameraAt({0, 0, 5}, {0, 0, 0}));
  const Scene scene(std::move(data));
  const RenderResult r = render(scene, settingsOf("gdpt", 32, 32, 4));
  for (int x = 0; x < 32; ++x) CHECK(r.image.pixel(r.image[0].index(x, 0)) == Vec3(0.25f, 0.5f, 1));
  CHECK(estimateOf(r).variance[1].at(0, 31) == 0);
  CHECK(estimateOf(r).variance[1].at(16, 16) > 0);
}

}  // namespace braid::test_gdpt
