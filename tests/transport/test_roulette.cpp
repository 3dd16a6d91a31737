// SPDX-License-Identifier: Apache-2.0
// Russian roulette: probabilities, the mean whatever they are, and less noise for as many rays.
#include <doctest/doctest.h>

#include "integrators/path_kernel.h"
#include "renderer/scene/data/gltf.h"
#include "tests/support/render_fixture.h"

namespace braid::test_roulette {

using namespace test;

namespace {

struct Traced {
  Measured mean;        // of all images
  double variance = 0;  // of a pixel of one image, mean over pixels
  double rays = 0;      // of all images
};

// What the path kernel finds with one roulette, in images of 32 samples per pixel that fill a pixel evenly.
Traced trace(const Scene& scene, const Roulette& roulette, uint64_t firstSeed) {
  constexpr int kWidth = 24, kHeight = 16, kSeeds = 16;
  constexpr uint64_t kPasses = 32;
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settingsFor(kWidth, kHeight, 1), integrators());
  const TransportContext context(scene, plan.settings.lightStrategy);
  Traced traced;
  std::vector<double> sum(kWidth * kHeight), squares(sum.size());
  double squaresOfMeans = 0;
  for (uint64_t seed = firstSeed; seed < firstSeed + kSeeds; ++seed) {
    std::vector<double> image(sum.size());
    for (uint64_t pass = 0; pass < kPasses; ++pass) {
      const PassSampler sampler(SamplerKind::Sobol, seed, 1, pass);
      for (int y = 0; y < kHeight; ++y) {
        PathKernel kernel(context, plan, sampler, nullptr, roulette);
        for (int x = 0; x < kWidth; ++x) kernel.start(x, y, sampler.itemKey(pixelItem(plan, x, y)));
        kernel.run();
        for (int x = 0; x < kWidth; ++x)
          image[static_cast<size_t>(y * kWidth + x)] +=
              static_cast<double>(average(kernel.sample(x).radiance)) / kPasses;
        traced.rays += static_cast<double>(kernel.rayCount + kernel.shadowRayCount);
      }
    }
    double mean = 0;
    for (size_t i = 0; i < image.size(); ++i) {
      sum[i] += image[i];
      squares[i] += sqr(image[i]);
      mean += image[i] / static_cast<double>(image.size());
    }
    traced.mean.value += mean / kSeeds;
    squaresOfMeans += sqr(mean) / kSeeds;
  }
  traced.mean.error = std::sqrt((squaresOfMeans - sqr(traced.mean.value)) / (kSeeds - 1));
  for (size_t i = 0; i < sum.size(); ++i)
    traced.variance += (squares[i] - sqr(sum[i]) / kSeeds) / (kSeeds - 1) / static_cast<double>(sum.size());
  return traced;
}

}  // namespace

TEST_CASE("roulette: probabilities") {
  const Roulette roulette{3, 0.5f};
  CHECK(roulette.survival(2, 0.01f) == 1);  // too early
  CHECK(roulette.survival(3, 0.5f) == 1);
  CHECK(roulette.survival(3, 0.75f) == 1);
  CHECK(roulette.survival(3, 0.25f) == 0.5f);
  CHECK(roulette.survival(30, 0.0f) == 0);
  CHECK(Roulette{Roulette::kNever, 1}.survival(1000000, 0.0f) == 1);
}

TEST_CASE("roulette: the same mean, and the path tracer's has less noise for its rays") {
  const Roulette byAbsorption{4, 1}, never{Roulette::kNever, 1};
  double overAbsorption = 1, overNever = 1;  // products of variance times rays over scenes
  for (const char* name : {"cornell", "interior", "forest"}) {
    const Scene scene(loadGltf(sourcePath(std::string("scenes/") + name + ".glb")));
    const Traced pt = trace(scene, {}, 1), absorbed = trace(scene, byAbsorption, 101), full = trace(scene, never, 201);
    CAPTURE(name);
    for (const Traced& other : {absorbed, full})
      CHECK(std::abs(pt.mean.value - other.mean.value) < kSigmas * std::hypot(pt.mean.error, other.mean.error));
    overAbsorption *= pt.variance * pt.rays / (absorbed.variance * absorbed.rays);
    overNever *= pt.variance * pt.rays / (full.variance * full.rays);
  }
  MESSAGE("variance times rays over those of roulette by absorption ", std::cbrt(overAbsorption), ", of none ",
          std::cbrt(overNever));
  CHECK(std::cbrt(overAbsorption) < 0.95);
  CHECK(std::cbrt(overNever) < 0.5);
}

}  // namespace braid::test_roulette
