// SPDX-License-Identifier: Apache-2.0
// The regression engine on inputs that break regressions, and with few models.
#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/regression/colour_weights.h"
#include "combiners/regression/regression.h"
#include "tests/combiners/denoise/regression_scene.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_regression_extremes {

using namespace test;
using namespace test::regression_scene;

TEST_CASE("An image that is affine in the features comes back exactly, up to the ridge") {
  const int width = 70, height = 60;
  const Scene scene(width, height);
  const Rgb<float> affine = imageOf(width, height, [&](int x, int y, int c) {
    return 2 + 0.5 * c + 0.7 * static_cast<double>(scene.normal[1].at(x, y)) -
           0.4 * static_cast<double>(scene.depth.at(x, y)) + 0.9 * static_cast<double>(scene.flag.at(x, y));
  });
  const Rgb<float> black(width, height);
  RegressionInputs in;
  in.features = {{&scene.normal[0], &scene.normal[1], &scene.normal[2]}, {&scene.depth}, {&scene.flag}};
  in.terms = {{&affine, &scene.equal}};
  in.fallback = &black;
  for (const int stride : {1, 4}) {
    RegressionSettings s;
    s.stride = stride;
    s.fallbackWeight = 0;
    s.ridge = 1e-5;
    CHECK(largestDifference(regress(in, s), affine) < 5e-4);  // of values up to 10, in float
    s.ridge = 0.1;  // against at least 26² pixels in a corner: relative error 0.1 / 676 of the intercept
    const double error = largestDifference(regress(in, s), affine);
    CHECK(error < 0.02);
    CHECK(error > 1e-5);
  }
}

TEST_CASE("Constant and collinear features, absent weights and huge values leave a finite image and are counted") {
  const int width = 40, height = 33;
  Scene scene(width, height);
  const Plane<float> constant(width, height, 0.3f);
  Plane<float> twice = scene.depth;
  for (float& v : twice.data) v *= 2;
  RegressionInputs in = scene.inputs();
  in.terms = {{&scene.target, &scene.equal}};
  in.reconstruction = nullptr;
  in.features = {{&constant}, {&scene.depth}, {&twice}};
  RegressionSettings s;
  s.ridge = 0;
  RegressionReport report;
  const Rgb<float> out = regress(in, s, &report);
  CHECK(allFinite(out));
  CHECK(report.models == 10 * 9);
  CHECK(report.raisedRidge == report.models);
  CHECK(report.constantModels == 0);
  CHECK(report.attribute("r").text.find("90 models, 0 of them of single pixels, 90 with a raised ridge") == 0);
  // The duplicate changes nothing but rounding: the ridge shares the slope out.
  in.features = {{&scene.depth}};
  CHECK(largestDifference(out, regress(in, s)) < 1e-2);

  scene.target[0].at(3, 3) = 3e38f;
  scene.normal[1].at(20, 20) = -3e38f;
  scene.normal[1].at(22, 20) = 3e38f;
  CHECK(allFinite(regress(scene.inputs(), RegressionSettings())));
}

TEST_CASE("Images of 1 x 1 and 7 x 3 pixels, strides and windows larger than the image") {
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{7, 3}, std::pair{1, 40}})
    for (const int stride : {1, 4, 64}) {
      const Scene scene(width, height);
      RegressionSettings s;
      s.stride = stride;
      const Rgb<float> out = regress(scene.inputs(), s);
      CHECK(out.width() == width);
      CHECK(out.height() == height);
      CHECK(allFinite(out));
      CHECK(centrePosition(centreCount(width, stride) - 1, width, stride) < width);
    }
}

TEST_CASE("The number of threads changes no bit of a regression") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Scene scene(61, 150);
  RegressionSettings s;
  s.radius = 9;
  s.stride = 3;
  Rgb<float> results[3];
  size_t k = 0;
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    results[k++] = arena.execute([&] { return regress(scene.inputs(), s); });
  }
  CHECK(identical(results[0], results[1]));
  CHECK(identical(results[0], results[2]));
}

TEST_CASE("A glint that resembles no strided centre comes out as its fallback, not as an average of strangers") {
  const int size = 64;
  Rgb<float> guide(size, size, 0.2f);
  for (size_t c = 0; c < 3; ++c) guide[c].at(33, 37) = 5;  // not one of the centres 2, 6, 10, …
  const ColourWeights weights(guide, 0.02f);
  RegressionInputs in;
  in.terms = {{&guide, &weights}};
  in.fallback = &guide;
  RegressionSettings s;
  RegressionReport report;
  const Rgb<float> blended = regress(in, s, &report);
  CHECK(blended[0].at(33, 37) == doctest::Approx(5));
  CHECK(report.fallbackPixels == 1);
  CHECK(blended[0].at(30, 37) == doctest::Approx(0.2).epsilon(1e-3));
  // A little likeness is enough to spoil it without the blend: the weights of all centres are small, but normalised.
  for (size_t c = 0; c < 3; ++c) guide[c].at(33, 37) = 0.2f + 0.25f;
  const ColourWeights near(guide, 0.02f);
  in.terms = {{&guide, &near}};
  s.fallbackWeight = 0;
  const double without = static_cast<double>(regress(in, s)[0].at(33, 37));
  s.fallbackWeight = 2;
  const double with = static_cast<double>(regress(in, s)[0].at(33, 37));
  CHECK(without < 0.21);
  CHECK(with > 0.44);
}

TEST_CASE("Pixels that few strided models reach get a model of their own, as with a model at every pixel") {
  // A thin line beside the centres, of its own colour and brightness gradient; noise-free targets.
  const int size = 80;
  const auto line = [](int x) { return x == 33; };
  const Rgb<float> truth =
      imageOf(size, size, [&](int x, int y, int) { return line(x) ? 3 + 0.02 * y : 0.2 + 0.001 * x; });
  const Rgb<float> guide = imageOf(size, size, [&](int x, int, int) { return line(x) ? 1.0 : 0.2; });
  const Plane<float> height = planeOf(size, size, [](int, int y) { return y / 80.0; });
  const Plane<float> across = planeOf(size, size, [](int x, int) { return x / 80.0; });
  const Rgb<float> fallback(size, size, 0.5f);
  const ColourWeights weights(guide, 0.02f);
  RegressionInputs in;
  in.features = {{&height}, {&across}};
  in.terms = {{&truth, &weights}};
  in.fallback = &fallback;
  const auto lineError = [&](const RegressionSettings& s, RegressionReport* report = nullptr) {
    const Rgb<float> out = regress(in, s, report);
    double error = 0;
    for (int y = 0; y < size; ++y)
      error += sqr(static_cast<double>(out[0].at(33, y)) - static_cast<double>(truth[0].at(33, y))) / size;
    return error;
  };
  RegressionReport report;
  const RegressionSettings own = stridedSettings(4, nullptr);
  RegressionSettings without = own;
  without.ownModelBelow = 0;
  const double with = lineError(own, &report);
  CHECK(lineError(without) > 4);  // the fallback
  CHECK(with < 0.05);
  CHECK(report.ownModels == size);
  CHECK(report.models == 400 + size);
}

TEST_CASE("Cancelled regressions return at once") {
  const Scene scene(64, 64);
  const std::atomic<bool> cancel{true};
  RegressionSettings s;
  s.cancel = &cancel;
  RegressionReport report;
  regress(scene.inputs(), s, &report);
  CHECK(report.models == 0);
}

}  // namespace braid::test_regression_extremes
