// SPDX-License-Identifier: Apache-2.0
// Direct light by itself: what the path tracer takes for it, its sums, when it is kept, and what "auto" gains by it.
#include <cmath>
#include <limits>
#include <random>

#include <doctest/doctest.h>

#include "combiners/statistics/direct_indirect.h"
#include "combiners/pipeline/pipeline.h"
#include "renderer/film/direct_light.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/render_fixture.h"
#include "tools/options/combining.h"

namespace braid::test_direct_indirect {

using namespace test;

namespace {

Settings withParts(uint64_t spp, int maxDepth = 32) {
  Settings s = settingsFor(24, 20, spp);
  s.keep.directIndirect = s.keep.quarters = true;
  s.maxDepth = maxDepth;
  return s;
}

bool near(const Rgb<float>& a, const Rgb<float>& b, float tolerance) {
  bool ok = a.size() == b.size();
  for (size_t c = 0; ok && c < 3; ++c)
    for (size_t i = 0; ok && i < a.size(); ++i)
      ok = std::fabs(a[c][i] - b[c][i]) <= tolerance * (1 + std::fabs(a[c][i]));
  return ok;
}

// A floor that is a mirror under a lamp, in the dark: the camera sees the lamp in it, or nothing.
SceneData mirrorUnderLamp() {
  SceneData data;
  Material mirror = diffuseMaterial(Spectrum(0.8f));
  mirror.metallic = 1;
  mirror.roughness = 0;
  Material lamp = diffuseMaterial(Spectrum(0));
  lamp.emission = Spectrum(5, 4, 3);
  data.materials = {mirror, lamp};
  TriangleMesh floor, light;
  addQuad(floor, Vec3(-4, 0, 4), Vec3(8, 0, 0), Vec3(0, 0, -8));
  addQuad(light, Vec3(-1, 2, -1), Vec3(2, 0, 0), Vec3(0, 0, 2));
  addMesh(data, std::move(floor), 0);
  addMesh(data, std::move(light), 1);
  data.cameras.push_back(cameraAt(Vec3(0, 1.5f, 3), Vec3(0, 0, 0)));
  return data;
}

// An image of n passes with its halves, quarters left out: direct light with a checkerboard and little noise, and
// smooth indirect light with much.
struct TwoLights {
  Rgb<float> truth;
  Estimates estimates;
};

TwoLights twoLights(int width, int height, uint64_t passes, double directNoise, double indirectNoise) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  TwoLights out{Rgb<float>(width, height), {}};
  out.estimates.width = width;
  out.estimates.height = height;
  Estimate e;
  e.name = "pt";
  e.passes = passes;
  const auto blank = [&] { return Rgb<float>(width, height); };
  for (Rgb<float>* image : {&e.mean, &e.half[0], &e.half[1], &e.variance, &e.direct.mean, &e.direct.half[0],
                            &e.direct.half[1], &e.direct.variance, &e.indirectVariance})
    *image = blank();
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (size_t c = 0; c < 3; ++c) {
        const double direct = (x / 3 + y / 3) % 2 ? 0.8 : 0.1, indirect = 0.3 + 0.2 * x / width;
        const size_t i = out.truth[c].index(x, y);
        out.truth[c][i] = static_cast<float>(direct + indirect);
        for (size_t h = 0; h < 2; ++h) {
          const double d = direct + directNoise * normal(random), rest = indirect + indirectNoise * normal(random);
          e.direct.half[h][c][i] = static_cast<float>(d);
          e.half[h][c][i] = static_cast<float>(d + rest);
        }
        e.direct.mean[c][i] = 0.5f * (e.direct.half[0][c][i] + e.direct.half[1][c][i]);
        e.mean[c][i] = 0.5f * (e.half[0][c][i] + e.half[1][c][i]);
        e.direct.variance[c][i] = static_cast<float>(sqr(directNoise) / 2);
        e.indirectVariance[c][i] = static_cast<float>(sqr(indirectNoise) / 2);
        e.variance[c][i] = e.direct.variance[c][i] + e.indirectVariance[c][i];
      }
  out.estimates.estimates.push_back(std::move(e));
  return out;
}

PipelineOutput autoOf(const Estimates& e, double directIndirect) {
  PipelineOptions options;
  options.numbers.set("auto-direct-indirect", directIndirect);
  const PipelineResult result = runPipeline(e, {"auto"}, options);
  const PipelineOutput* out = result.find("auto");
  REQUIRE(out);
  REQUIRE(out->ran());
  return *out;
}

double squaredError(const Rgb<float>& image, const Rgb<float>& truth) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < image.size(); ++i) sum += sqr(static_cast<double>(image[c][i] - truth[c][i]));
  return sum / static_cast<double>(3 * image.size());
}

}  // namespace

TEST_CASE("Direct light of a diffuse scene is the image of paths of at most two segments, to the bit") {
  const Scene scene(cornellBox());
  const RenderResult whole = render(scene, withParts(8)), direct = render(scene, withParts(8, 2));
  const Estimate &a = estimateOf(whole), &b = estimateOf(direct);
  CHECK(identical(a.direct.mean, b.mean));
  CHECK(identical(a.direct.half[1], b.half[1]));
  CHECK(identical(a.direct.variance, b.variance));
  CHECK(identical(b.direct.mean, b.mean));
  double more = 0;
  for (size_t i = 0; i < a.mean.size(); ++i) {
    CHECK(a.direct.mean[0][i] <= a.mean[0][i]);
    more += static_cast<double>(a.mean[0][i] - a.direct.mean[0][i]);
  }
  CHECK(more / static_cast<double>(a.mean.size()) > 0.03);  // the walls light one another
  // Nothing is left over: no variance either.
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < b.mean.size(); ++i) CHECK(b.indirectVariance[c][i] == 0);
}

TEST_CASE("A lamp in a mirror is direct light, and a clamp dims both parts") {
  Settings settings = withParts(4);
  const Scene scene(mirrorUnderLamp());
  const RenderResult result = render(scene, settings);
  const Estimate& e = estimateOf(result);
  float brightest = 0;
  for (size_t i = 0; i < e.mean.size(); ++i) brightest = std::max(brightest, e.mean[0][i]);
  CHECK(brightest > 1);
  CHECK(identical(e.direct.mean, e.mean));
  settings.clamp = 0.5f;
  const RenderResult clamped = render(scene, settings);
  CHECK(identical(estimateOf(clamped).direct.mean, estimateOf(clamped).mean));
}

TEST_CASE("Sums of the parts are those of accumulators of their own, also of shares and of values that are none") {
  constexpr int kWidth = 20, kHeight = 12, kPasses = 10;
  Accumulator whole(kWidth, kHeight, 4), direct(kWidth, kHeight, 4), indirect(kWidth, kHeight, 4);
  DirectLightAccumulator parts(kWidth, kHeight, 4), later(kWidth, kHeight, 4);
  PassTarget target(kWidth, kHeight, {.direct = true});
  std::mt19937 random(3);
  std::exponential_distribution<float> exponential;
  for (uint64_t pass = 0; pass < kPasses; ++pass) {
    target.clear();
    Rgb<float> d(kWidth, kHeight), rest(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        const Spectrum value(exponential(random), exponential(random), exponential(random));
        Spectrum part = value * 0.25f;
        if (x == 3 && y == 2) part = Spectrum(std::numeric_limits<float>::quiet_NaN());
        target.add(x, y, value);
        target.direct(x, y, part);
        if (x == 3 && y == 2) part = Spectrum(0);
        d.set(d[0].index(x, y), part);
        rest.set(d[0].index(x, y), value - part);
      }
    whole.commit(pass, target);
    (pass < 4 ? parts : later).commit(pass, target);
    direct.commit(pass, d);
    indirect.commit(pass, rest);
  }
  RawSums to, from;
  parts.listSums("", to);
  later.listSums("", from);
  addSums(to, from);
  parts.addCounts(later);
  for (const bool lowDiscrepancy : {false, true}) {
    const DirectLight part = parts.directPart(lowDiscrepancy);
    CHECK(near(part.mean, direct.mean(), 1e-6f));
    for (size_t h = 0; h < 2; ++h) CHECK(near(part.half[h], direct.halfMean(static_cast<int>(h)), 1e-6f));
    CHECK(near(part.variance, direct.variance(lowDiscrepancy), 1e-5f));
    CHECK(near(parts.indirectVariance(whole, lowDiscrepancy), indirect.variance(lowDiscrepancy), 1e-4f));
  }
}

TEST_CASE("Direct light is kept for auto without photon maps, on request, and not otherwise") {
  const Scene scene(cornellBox());
  const auto planned = [&](const std::vector<std::string>& names, const std::string& combine) {
    Settings settings = settingsFor(24, 20, 16);
    settings.integrators = names;
    Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
    CombineChoice choice;
    choice.methods = parseMethods(combine);
    planCombining(choice, 16, plan);
    return plan;
  };
  CHECK(planned({"pt"}, "auto").kept.directIndirect);
  CHECK_FALSE(planned({"pt"}, "none").kept.directIndirect);
  CHECK_FALSE(planned({"pt"}, "js@pw").kept.directIndirect);
  CHECK_FALSE(planned({"bdpt"}, "auto").kept.directIndirect);
  CHECK_FALSE(planned({"pt", "sppm"}, "auto").kept.directIndirect);
  const Plan with = planned({"pt"}, "auto"), without = planned({"pt"}, "ensemble@pw+nlm");
  CHECK(with.text().find("+ direct light by itself: for outputs or combiners") != std::string::npos);
  CHECK(without.text().find("- direct light by itself: no output or combiner reads it") != std::string::npos);
  CHECK(planned({"bdpt"}, "auto").text().find("no integrator tells it from the rest") != std::string::npos);
  CHECK(with.buckets() == 4);
  CHECK(with.filmBytesPerPixel == 120 + 12 + 224 + 144 + 12);  // sums and a pass: whole, features, parts
  // Of two passes the first filter alone is made, of the whole.
  const RenderResult one = render(scene, withParts(2));
  CHECK(hasDirectIndirect(estimateOf(one)));
  CHECK(identical(autoOf(*one.estimates, 1).result.image.mean, autoOf(*one.estimates, 0).result.image.mean));
}

TEST_CASE("auto filters parts apart: sharp direct light no longer costs smooth indirect light") {
  const TwoLights lights = twoLights(96, 72, 32, 0.01, 0.2);
  const double apart = squaredError(autoOf(lights.estimates, 1).result.image.mean, lights.truth);
  const double together = squaredError(autoOf(lights.estimates, 0).result.image.mean, lights.truth);
  const double noisy = squaredError(lights.estimates.estimates[0].mean, lights.truth);
  MESSAGE("error over that of the noisy image: apart ", apart / noisy, ", together ", together / noisy);
  CHECK(apart < 0.6 * together);
  CHECK(together < noisy);
  // The parts add up to the whole.
  const Estimate& e = lights.estimates.estimates[0];
  Estimate sum = directLight(e);
  addImage(sum, indirectLight(e));
  CHECK(near(sum.mean, e.mean, 1e-5f));
}

TEST_CASE("auto does without parts that are incomplete, and survives values that are none") {
  TwoLights lights = twoLights(40, 30, 16, 0.05, 0.1);
  Estimate& e = lights.estimates.estimates[0];
  const Rgb<float> whole = autoOf(lights.estimates, 0).result.image.mean;
  Estimates incomplete = lights.estimates;
  incomplete.estimates[0].direct.half[1] = {};
  CHECK(identical(autoOf(incomplete, 1).result.image.mean, whole));
  e.direct.mean[0][5] = e.direct.half[0][1][7] = std::numeric_limits<float>::quiet_NaN();
  e.direct.variance[2][9] = -1;
  e.indirectVariance[1][11] = std::numeric_limits<float>::infinity();
  const PipelineOutput out = autoOf(lights.estimates, 1);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < e.mean.size(); ++i) CHECK(std::isfinite(out.result.image.mean[c][i]));
  // A part without noise or light, or all of the light.
  for (const bool all : {false, true}) {
    TwoLights extreme = twoLights(40, 30, 16, 0.05, 0.1);
    Estimate& x = extreme.estimates.estimates[0];
    const Rgb<float> none(40, 30);
    x.direct = all ? DirectLight{x.mean, {x.half[0], x.half[1]}, x.variance} : DirectLight{none, {none, none}, none};
    x.indirectVariance = all ? none : x.variance;
    const double apart = squaredError(autoOf(extreme.estimates, 1).result.image.mean, extreme.truth);
    CHECK(apart < 1.05 * squaredError(autoOf(extreme.estimates, 0).result.image.mean, extreme.truth));
  }
}

}  // namespace braid::test_direct_indirect
