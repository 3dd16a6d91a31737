// SPDX-License-Identifier: Apache-2.0
// The James-Stein combiner as a method: better than both of its inputs, converging, with its ablations and extremes.
#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/pipeline/registry.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_james_stein {

using namespace test;

namespace {

MethodResult runJs(const Case& c, const std::string& biased, const std::map<std::string, double>& options = {}) {
  MethodInputs in = inputsOf(c, biased);
  for (const auto& [name, value] : options) in.options.set("js-" + name, value);
  return make_js()->run(in);
}

}  // namespace

TEST_CASE("The method beats both of its inputs with Y*, whose models at every fourth pixel do as well as all") {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  for (const char* biased : {"sppm", "wide"}) {
    const Case c = makeCase(o);
    const double x = meanSquaredError(c.pt().mean, c.truth), y = meanSquaredError(c.find(biased).mean, c.truth);
    const MethodResult result = runJs(c, biased);
    const double four = meanSquaredError(result.image.mean, c.truth);
    const double one = meanSquaredError(runJs(c, biased, {{"stride", 1}}).image.mean, c.truth);
    const double plain = meanSquaredError(runJs(c, biased, {{"regression", 0}}).image.mean, c.truth);
    INFO(std::string(biased), ": X ", x, " Y ", y, " JS ", four, " stride 1 ", one, " without regression ", plain);
    CHECK(four < 0.5 * std::min(x, y));
    CHECK(plain < std::min(x, y));
    CHECK(four < 1.08 * one);
    // Halves look like the image with more noise, and the error map tells the error of the whole within a factor of 2.
    for (const Rgb<float>& half : result.image.half) CHECK(meanSquaredError(half, c.truth) < 4 * four);
    double estimated = 0;
    for (const float e : result.error.data) estimated += static_cast<double>(e) / static_cast<double>(c.truth.size());
    CHECK(estimated > 0.5 * four);
    CHECK(estimated < 2 * four);
  }
}

TEST_CASE("The combination converges to X") {
  CaseOptions o;
  o.noise = 0.001;
  o.samples = 64;
  const Case c = makeCase(o);
  for (const char* biased : {"sppm", "wide"}) {
    const double js = meanSquaredError(runJs(c, biased).image.mean, c.truth);
    CHECK(js < 2 * meanSquaredError(c.pt().mean, c.truth));
    CHECK(js < 1e-4 * meanSquaredError(c.find(biased).mean, c.truth));
  }
}

TEST_CASE("The ablations of James-Stein are what they say") {
  CaseOptions o;
  const Case c = makeCase(o);
  const auto factor = [](const MethodResult& r, size_t ch) -> const Plane<float>& { return r.aovs.at(ch).plane; };
  const MethodResult global = runJs(c, "wide", {{"regression", 0}, {"global", 1}});
  for (const float f : factor(global, 0).data) CHECK(f == factor(global, 0)[0]);
  // Y closer to X than noise allows: SSE below its expectation.
  const MethodResult cut = runJs(c, "narrow", {{"regression", 0}, {"constant", 2}});
  const MethodResult uncut = runJs(c, "narrow", {{"regression", 0}, {"constant", 2}, {"positive-part", 0}});
  const auto least = [&](const MethodResult& r) {
    return *std::min_element(factor(r, 1).data.begin(), factor(r, 1).data.end());
  };
  CHECK(least(cut) >= 0);
  CHECK(least(uncut) < 0);
  const MethodResult crossed = runJs(c, "wide", {{"crossed", 1}});
  for (size_t i = 0; i < c.truth.size(); ++i)
    CHECK(crossed.image.mean[0][i] ==
          doctest::Approx(0.5 * static_cast<double>(crossed.image.half[0][0][i] + crossed.image.half[1][0][i])));
  CHECK(crossed.error.empty());
  CHECK(meanSquaredError(crossed.image.mean, c.truth) < meanSquaredError(c.find("wide").mean, c.truth));
}

TEST_CASE("One pass gives Y; images without variance, of one pixel, or without features and halves come out finite") {
  CaseOptions o;
  o.samples = 1;
  o.width = o.height = 9;
  const Case one = makeCase(o);
  CHECK(identical(runJs(one, "wide").image.mean, one.find("wide").mean));
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{7, 3}}) {
    o = CaseOptions();
    o.width = width;
    o.height = height;
    const Case c = makeCase(o);
    CHECK(allFinite(runJs(c, "sppm").image.mean));
    MethodInputs in = inputsOf(c, "wide");
    in.features = nullptr;
    Estimate x = c.pt(), y = c.find("wide");
    x.variance = Rgb<float>();
    in.unbiased = &x;
    in.biased = &y;
    CHECK(allFinite(make_js()->run(in).image.mean));
    y.half[0] = y.half[1] = Rgb<float>();
    const MethodResult plain = make_js()->run(in);
    CHECK(allFinite(plain.image.mean));
    CHECK(plain.image.half[0].empty());
  }
  o.noise = 0;
  CHECK(allFinite(runJs(makeCase(o), "sppm").image.mean));
}

TEST_CASE("The number of threads changes no bit of James-Stein") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Case c = makeCase();
  MethodResult results[3];
  size_t k = 0;
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    results[k++] = arena.execute([&] { return runJs(c, "wide"); });
  }
  for (size_t i : {size_t(1), size_t(2)}) {
    CHECK(identical(results[0].image.mean, results[i].image.mean));
    CHECK(identical(results[0].image.half[1], results[i].image.half[1]));
    CHECK(identical(results[0].error, results[i].error));
  }
}

}  // namespace braid::test_james_stein
