// SPDX-License-Identifier: Apache-2.0
// The simple methods: box, average, inverse-variance, easy with its SURE maps, external and oidn.
#include <cstdlib>
#include <map>

#include <doctest/doctest.h>

#include "combiners/denoise/oidn/oidn.h"
#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "combiners/statistics/sure_map.h"
#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/gltf_fixture.h"

namespace braid::test_simple_methods {

using namespace test;

namespace {

MethodResult run(const char* name, const MethodInputs& in) { return findMethod(name)->run(in); }

double meanOf(const Plane<float>& p) {
  double sum = 0;
  for (const float v : p.data) sum += static_cast<double>(v);
  return sum / static_cast<double>(p.size());
}

Estimate flat(float value, float variance, int width = 32, int height = 24) {
  Estimate e;
  e.mean = e.half[0] = e.half[1] = Rgb<float>(width, height, value);
  e.variance = Rgb<float>(width, height, variance);
  return e;
}

Rgb<float> checkered(int width, int height) {
  Rgb<float> image(width, height);
  for (size_t i = 0; i < image.size(); ++i) image.set(i, Vec3(static_cast<float>(i % 7), 1, static_cast<float>(i % 3)));
  return image;
}

void write(const std::string& path, const Rgb<float>& image) {
  ExrOptions options;
  options.floatHeadline = true;
  writeExr(path, {}, image, nullptr, options);
}

}  // namespace

TEST_CASE("box is the mean of 15x15 pixels, of what is left of them at borders") {
  Estimate e = flat(0, 0);
  e.mean[1].at(10, 12) = 225;
  MethodInputs in;
  in.unbiased = &e;
  const Rgb<float> out = run("box", in).image.mean;
  CHECK(out[1].at(10, 12) == 1);
  CHECK(out[1].at(17, 16) == 1);
  CHECK(out[1].at(18, 12) == 0);
  CHECK(out[0].at(10, 12) == 0);
  CHECK(out[1].at(3, 5) == doctest::Approx(225.0 / (11 * 13)));
  in.options.set("box-radius", 0);
  CHECK(identical(run("box", in).image.mean, e.mean));
}

TEST_CASE("average is the plain mean of the bases and of their halves") {
  const Case c = makeCase(sized(20, 16));
  MethodInputs in = inputsOf(c);
  const MethodResult r = run("average", in);
  const size_t i = 77;
  float sum = 0, half = 0;
  for (const Estimate* b : in.bases) {
    sum += b->mean[2][i];
    half += b->half[1][2][i];
  }
  CHECK(r.image.mean[2][i] == doctest::Approx(sum / 3));
  CHECK(r.image.half[1][2][i] == doctest::Approx(half / 3));
  Estimate noHalves = *in.bases[0];
  noHalves.half[0] = Rgb<float>();
  in.bases[0] = &noHalves;
  CHECK(run("average", in).image.half[0].empty());
}

TEST_CASE("inverse-variance follows the errors of its inputs to both ends") {
  MethodInputs in;
  // Unbiased without variance: it is taken as it is. The biased one without error: it is.
  const Estimate exact = flat(0.5f, 0), noisy = flat(0.5f, 0.1f), wrong = flat(0.9f, 0);
  in.unbiased = &exact;
  in.biased = &wrong;
  CHECK(meanOfImage(run("inverse-variance", in).image.mean) == doctest::Approx(0.5));
  CHECK(meanOf(run("inverse-variance", in).error) == 0);
  in.unbiased = &noisy;
  in.biased = &exact;
  CHECK(meanOfImage(run("inverse-variance", in).image.mean) == doctest::Approx(0.5));
  // Variance v = 0.02, halves that differ from y by 0.4: m = 0.16 - 2 v = 0.12, weight of y = v / (v + m) = 1/7.
  const Estimate spread = flat(0.5f, 0.02f);
  in.unbiased = &spread;
  in.biased = &wrong;
  const MethodResult r = run("inverse-variance", in);
  CHECK(meanOfImage(r.image.mean) == doctest::Approx(0.5 + 0.4 / 7).epsilon(1e-5));
  CHECK(meanOf(r.error) == doctest::Approx(0.12 / 7).epsilon(1e-5));
  CHECK(meanOf(r.aovs.at(0).plane) == doctest::Approx(1.0 / 7).epsilon(1e-5));
}

TEST_CASE("inverse-variance beats both inputs where each is good somewhere, and knows its error") {
  for (const char* biased : {"sppm", "wide"}) {
    const Case c = makeCase(sized(96, 72, 32));
    const MethodInputs in = inputsOf(c, biased);
    const MethodResult r = run("inverse-variance", in);
    const double error = meanSquaredError(r.image.mean, c.truth);
    CAPTURE(std::string(biased));
    CHECK(error < meanSquaredError(in.unbiased->mean, c.truth));
    CHECK(error < meanSquaredError(in.biased->mean, c.truth));
    CHECK(meanOf(r.error) > 0.5 * error);
    CHECK(meanOf(r.error) < 2 * error);
  }
}

TEST_CASE("The mean of the SURE map is the error of a linear denoiser") {
  // By pairs of images of 24 seeds: |mean| within 4 standard errors, a false alarm in 1800 runs by Student's t with 23
  // degrees of freedom. The estimate is unbiased for linear filters under any noise of known variance.
  std::vector<double> differences;
  double error = 0;
  for (uint64_t seed = 1; seed <= 24; ++seed) {
    CaseOptions o = sized(48, 36, 16, seed);
    o.noise = 1;
    const Case c = makeCase(o);
    const auto denoise = [](const Rgb<float>& image) { return detail::boxFilter(image, 2); };
    const Rgb<float> d = denoise(c.pt().mean);
    const double sure = meanOfImage(sureMaps(c.pt().mean, d, c.pt().variance, seed, 0.1, denoise).risk);
    differences.push_back(sure - meanSquaredError(d, c.truth));
    error += meanSquaredError(d, c.truth) / 24;
  }
  double mean = 0, square = 0;
  for (const double d : differences) mean += d / 24;
  for (const double d : differences) square += sqr(d - mean);
  const double deviation = std::sqrt(square / 23 / 24);
  CHECK(std::fabs(mean) < 4 * deviation);
  CHECK(deviation < 0.1 * error);
}

TEST_CASE("The filter of the maps keeps constants, is the identity when narrow, and its width follows the variance") {
  const Rgb<float> image = checkered(20, 15);
  CHECK(std::sqrt(meanSquaredError(gaussianFiltered(image, 0.1), image)) < 1e-6);
  const Rgb<float> wide = gaussianFiltered(Rgb<float>(20, 15, 3), 100);
  CHECK(std::sqrt(meanSquaredError(wide, Rgb<float>(20, 15, 3))) < 1e-6);
  Rgb<float> peak(31, 31);
  peak[0].at(15, 15) = 121;
  CHECK(gaussianFiltered(peak, 1e6)[0].at(20, 10) == doctest::Approx(1));
  CHECK(gaussianFiltered(peak, 1e6)[0].at(21, 15) == 0);
  CHECK(sureMapFilterSigma(Rgb<float>(40, 30, 0.0001f)) == doctest::Approx(1));
  CHECK(sureMapFilterSigma(Rgb<float>(40, 30, 9)) == doctest::Approx(100));
  CHECK(sureMapFilterSigma(Rgb<float>(40, 30, 0)) == doctest::Approx(0.1));
  // Fireflies, up to one value in a thousand, do not widen it.
  Rgb<float> firefly(100, 100, 0.0001f);
  firefly[1].at(5, 5) = 1e6f;
  CHECK(sureMapFilterSigma(firefly) == doctest::Approx(1));
}

TEST_CASE("Negative errors become zero where denoising helps, and their size elsewhere") {
  const Rgb<float> variance(2, 1, 1);
  Rgb<float> unfiltered(2, 1, 0.5f), filtered(2, 1, -0.25f);
  for (Plane<float>* p : {&unfiltered[1]}) p->data = {2, 2};
  applySignRule(filtered, unfiltered, variance);
  CHECK(filtered[0][0] == 0);
  CHECK(filtered[1][0] == 0.25f);
}

TEST_CASE("easy takes the better of noisy and denoised nearly everywhere") {
  CaseOptions o = sized(96, 72, 64);
  const Case c = makeCase(o);
  const PipelineResult r = runPipeline(c.estimates, {"easy@box"}, {});
  const PipelineOutput& out = *r.find("easy@box");
  REQUIRE(out.ran());
  const double noisy = meanSquaredError(c.pt().mean, c.truth);
  const double box = meanSquaredError(r.find("box")->result.image.mean, c.truth);
  const double easy = meanSquaredError(out.result.image.mean, c.truth);
  CHECK(easy < noisy);
  CHECK(easy < box);
  CHECK(meanOf(out.result.error) > 0.5 * easy);
  CHECK(meanOf(out.result.error) < 2 * easy);
  for (size_t i = 0; i < 96 * 72; ++i) {
    const float v = out.result.image.mean[0][i], n = c.pt().mean[0][i], d = r.find("box")->result.image.mean[0][i];
    const float near = 1e-5f * (std::fabs(n) + std::fabs(d));
    REQUIRE((std::fabs(v - n) <= near || std::fabs(v - d) <= near));
  }
}

TEST_CASE("easy without a denoiser to run again says so") {
  const Case c = makeCase(sized(16, 12));
  CHECK_THROWS_WITH_AS(run("easy", inputsOf(c, "sppm")), doctest::Contains("denoiser"), Error);
}

TEST_CASE("external reads another denoiser's files in the units of the render") {
  const Folder folder;
  CaseOptions o = sized(20, 16);
  o.light = 50;
  const Case c = makeCase(o);
  const Estimate& d = c.find("narrow");
  const std::string base = folder.path / "d";
  write(base + ".exr", d.mean);
  write(base + "A.exr", d.half[0]);
  write(base + "B.exr", d.half[1]);
  const std::string one = "external:" + base + ".exr", three = one + ":" + base + "A.exr:" + base + "B.exr";
  const PipelineResult r =
      runPipeline(c.estimates, {one, three, "inverse-variance@" + one, "inverse-variance@" + three}, {});
  REQUIRE(r.find(one)->ran());
  CHECK(std::sqrt(meanSquaredError(r.find(one)->result.image.mean, d.mean)) < 1e-6 * meanOfImage(d.mean));
  CHECK(r.find(one)->result.image.half[0].empty());
  CHECK(std::sqrt(meanSquaredError(r.find(three)->result.image.half[1], d.half[1])) < 1e-6 * meanOfImage(d.mean));
  CHECK(r.find("inverse-variance@" + one)->step.skipReason == "needs the halves of " + one);
  CHECK(r.find("inverse-variance@" + three)->ran());

  // Halves as layers of the same file, and a size that does not fit.
  Estimates layers;
  ExrOptions options;
  options.floatHeadline = true;
  options.layers = {{"halfA", &d.half[0]}, {"halfB", &d.half[1]}};
  writeExr(base + "all.exr", layers, d.mean, nullptr, options);
  const PipelineResult all = runPipeline(c.estimates, {"external:" + base + "all.exr"}, {});
  CHECK_FALSE(all.outputs[0].result.image.half[1].empty());
  const PipelineResult small = runPipeline(makeCase(sized(8, 8)).estimates, {one}, {});
  CHECK(small.outputs[0].step.skipReason.find("20x16") != std::string::npos);
  CHECK_FALSE(findMethod("external")->name() == nullptr);
  const CombinePlan bare = makeCombinePlan(availableIn(c.estimates), {"external"}, {});
  CHECK(bare.find("external")->skipReason.find("external:FILE") != std::string::npos);
}

namespace {

// A library of denoising that averages each pixel with a constant, and notes what it was given.
struct FakeOidn {
  struct Image {
    float* pixels;
    size_t width, height;
    int format;
  };
  std::map<std::string, Image> images;
  std::map<std::string, float> settings;
  int devices = 0, filters = 0, executed = 0, error = 0;
  bool committed = false;
};
FakeOidn fake;

OidnApi fakeApi() {
  fake = {};
  using Handle = OidnApi::Handle;
  OidnApi api;
  api.newDevice = [](int type) -> Handle { return type == 1 && ++fake.devices ? &fake : nullptr; };
  api.commitDevice = [](Handle) { fake.committed = true; };
  api.getDeviceError = [](Handle, const char** message) {
    *message = "weights are missing";
    return fake.error;
  };
  api.releaseDevice = [](Handle) { --fake.devices; };
  api.newFilter = [](Handle, const char* type) -> Handle {
    return std::string(type) == "RT" && ++fake.filters ? &fake.filters : nullptr;
  };
  api.setSharedFilterImage = [](Handle, const char* name, void* pixels, int format, size_t w, size_t h, size_t, size_t,
                                size_t) {
    fake.images[name] = {static_cast<float*>(pixels), w, h, format};
  };
  api.setFilterBool = [](Handle, const char* name, bool value) { fake.settings[name] = value; };
  api.setFilterFloat = [](Handle, const char* name, float value) { fake.settings[name] = value; };
  api.commitFilter = [](Handle) {};
  api.executeFilter = [](Handle) {
    ++fake.executed;
    const FakeOidn::Image &in = fake.images.at("color"), &out = fake.images.at("output");
    for (size_t i = 0; i < 3 * in.width * in.height; ++i) out.pixels[i] = 0.5f * in.pixels[i] + 1;
  };
  api.releaseFilter = [](Handle) { --fake.filters; };
  return api;
}

}  // namespace

TEST_CASE("oidn hands over colours and features at a fixed scale, for the image and both halves") {
  Case c = makeCase(sized(10, 6));
  c.estimates.estimates[0].mean[1].at(3, 2) = -4;  // a perturbed pixel: the library takes none below 0
  const OidnApi api = fakeApi();
  const MethodResult r = makeOidn(&api, "")->run(inputsOf(c));
  CHECK(fake.executed == 3);
  CHECK(fake.filters == 0);
  CHECK(fake.devices == 0);
  CHECK(fake.committed);
  CHECK(fake.settings.at("hdr") == 1);
  CHECK(fake.settings.at("inputScale") == 1);
  for (const char* name : {"color", "albedo", "normal", "output"}) {
    CHECK(fake.images.at(name).width == 10);
    CHECK(fake.images.at(name).height == 6);
    CHECK(fake.images.at(name).format == 3);
  }
  CHECK(r.image.mean[2].at(7, 4) == 0.5f * c.pt().mean[2].at(7, 4) + 1);
  CHECK(r.image.mean[1].at(3, 2) == 1);
  CHECK(r.image.half[1][0].at(9, 5) == 0.5f * c.pt().half[1][0].at(9, 5) + 1);
}

TEST_CASE("oidn reports what its library says, and its absence in a sentence") {
  const Case c = makeCase(sized(10, 6));
  const OidnApi api = fakeApi();
  fake.error = 4;
  CHECK_THROWS_WITH_AS(makeOidn(&api, "")->run(inputsOf(c)), doctest::Contains("weights are missing"), Error);
  CHECK(fake.devices == 0);
  std::string reason;
  CHECK(loadOidn("libno-such-denoiser.so", reason) == nullptr);
  CHECK(reason.find("not installed") != std::string::npos);
  // A library that is no denoiser.
  CHECK(loadOidn("libm.so.6", reason) == nullptr);
  CHECK(reason.find("lacks functions") != std::string::npos);
  const auto absent = makeOidn(nullptr, "not installed here");
  CHECK(dynamic_cast<const ExternalMethod&>(*absent).skipReason() == "not installed here");
}

}  // namespace braid::test_simple_methods
