// SPDX-License-Identifier: Apache-2.0
// What double shrinkage makes of photon maps beyond the paper: light that the unbiased image has not met, and priors
// where they are of use.
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include <doctest/doctest.h>

#include "combiners/shrinkage/double_shrinkage.h"
#include "combiners/shrinkage/shrinkage_errors.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/plane_mean.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/noisy_images.h"

namespace braid::test_photon_map_shrinkage {

using namespace test;

namespace {

// A caustic, which no path of the unbiased image has found.
double caustic(int x, int y) { return sqr(x - 60) + sqr(y - 45) < sqr(25) ? 1.0 : 0.2; }
double withoutCaustic(int, int) { return 0.2; }

double squaredErrorOf(const Rgb<float>& image, const std::function<double(int, int)>& truth) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) sum += sqr(static_cast<double>(image[c].at(x, y)) - truth(x, y));
  return sum / (3.0 * kWidth * kHeight);
}

MethodResult shrunk(const Estimate& x, const Estimate& y, const std::string& option = "", double value = 0) {
  MethodInputs in;
  in.unbiased = &x;
  in.biased = &y;
  if (!option.empty()) in.options.set("double-shrinkage-" + option, value);
  return make_double_shrinkage()->run(in);
}

Plane<float> raised(float error, const Estimate& x, const Estimate& y, float errorOfY) {
  Plane<float> out(kWidth, kHeight, error);
  countMissingLight(out, x, x.variance, y, Plane<float>(kWidth, kHeight, errorOfY));
  return out;
}

}  // namespace

TEST_CASE("Missing light is the unbiased image's error, less what the photon map's own error explains") {
  const auto level = [](double value) { return [value](int, int) { return value; }; };
  const Estimate s = photonMap(level(1), 0, 1);
  // 0.8 is missing; 0.04 of its square is the photon map's.
  CHECK(raised(1e-3f, noisy(level(0.2), 0, 2), s, 0.04f)[500] == doctest::Approx(0.8 * 0.8 - 0.04));
  CHECK(raised(2, noisy(level(0.2), 0, 2), s, 0.04f)[500] == 2);          // its variance knows of more
  CHECK(raised(1e-3f, noisy(level(1.8), 0, 2), s, 0.04f)[500] == 1e-3f);  // too bright is no sign
  CHECK(raised(1e-3f, noisy(level(0.2), 0, 2), s, 0.6f)[500] == 1e-3f);   // 1.1 sqrt(0.6) > 0.8: a known bias
  // Three deviations of a mean over 169 pixels: 0.2 is missing, 1.1 * 0.1 explained, so 0.03 would have to be noise.
  const double deviation = std::sqrt(2.0) * 0.03 * 13;
  CHECK(raised(1e-3f, noisy(level(0.8), 0.5 * deviation, 3), s, 0.01f)[45 * kWidth + 60] > 0.01f);
  CHECK(raised(1e-3f, noisy(level(0.8), 2 * deviation, 3), s, 0.01f)[45 * kWidth + 60] == 1e-3f);
}

TEST_CASE("Fireflies of a photon map are no light that the unbiased image lacks, unless several agree") {
  const Estimate x = noisy(one, 0.01, 14);
  Estimate s = photonMap(one, 0.01, 15);
  const auto fireflyAt = [&s](int column, int row) {
    const size_t i = s.mean[0].index(column, row);
    for (size_t c = 0; c < 3; ++c) {
      s.mean[c][i] = 1 + 1000;
      s.half[0][c][i] = 1 + 2000;
      s.variance[c][i] = 1000.0f * 1000;  // one pass of many has found it
    }
  };
  const auto mostRaised = [&] {
    float most = 0;
    const Plane<float> e = raised(1e-3f, x, s, 1e-4f);
    for (int dy = -6; dy <= 6; ++dy)
      for (int dx = -6; dx <= 6; ++dx) most = std::max(most, e.at(60 + dx, 45 + dy));
    return most;
  };
  fireflyAt(60, 45);
  CHECK(mostRaised() == 1e-3f);
  fireflyAt(63, 42);
  CHECK(mostRaised() == 1e-3f);
  fireflyAt(57, 44);
  fireflyAt(61, 48);
  CHECK(mostRaised() > 100);
}

TEST_CASE("A bias of a million that the photon map knows of is not missing light for the roundings in it") {
  const Estimate x = noisy(one, 0.1, 4);
  const Estimate s = photonMap([](int, int) { return 1e6 + 1; }, 0.1, 5);
  for (const float known : {0.97f, 1.0f, 1.03f})
    for (const float e : raised(1e-3f, x, s, known * 1e12f).data) CHECK(e == 1e-3f);
}

TEST_CASE("double-shrinkage: a caustic that the unbiased image has not found comes from the photon map") {
  const Estimate x = noisy(withoutCaustic, 0.02, 6), s = photonMap(caustic, 0.1, 7);
  const MethodResult r = shrunk(x, s);
  const double error = squaredErrorOf(r.image.mean, caustic);
  CHECK(error < squaredErrorOf(s.mean, caustic));
  for (const char* option : {"measured", "fused"}) {
    CAPTURE(std::string(option));
    CHECK(squaredErrorOf(shrunk(x, s, option, 0).image.mean, caustic) > 2 * error);
  }
  // Halves that are measured against the unbiased image's would tell all of the caustic as an error.
  CHECK(planeMean(r.error) < 4 * error);
}

TEST_CASE("double-shrinkage: texture and shadow edges, which the prior blurs, stay where halves show them") {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.samples = 256;
  o.noise = 0.5;
  o.photonBlur = 1;
  const Case c = makeCase(o);
  const auto error = [&](const std::string& option, double value) {
    MethodInputs in = inputsOf(c, "sppm");
    in.options.set("double-shrinkage-debias", 0);
    in.options.set("double-shrinkage-" + option, value);
    const Rgb<float> image = make_double_shrinkage()->run(in).image.mean;
    double sum = 0;
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < image.size(); ++i) {
        const auto truth = static_cast<double>(c.truth[k][i]);
        sum += sqr(static_cast<double>(image[k][i]) - truth) / (sqr(truth) + 0.01);
      }
    return sum / (3.0 * static_cast<double>(image.size()));
  };
  const double chosen = error("chosen", 1), everywhere = error("chosen", 0), nowhere = error("stage", 1);
  INFO("chosen ", chosen, ", everywhere ", everywhere, ", nowhere ", nowhere);
  CHECK(nowhere < everywhere);
  CHECK(chosen < 0.9 * everywhere);
}

TEST_CASE("The error of the prior beside a bright edge is in units of the brightness") {
  // A prior that is off by a tenth everywhere: 1 on the left, 0.01 on the right.
  const auto value = [](int x, int) { return x < 60 ? 10.0 : 0.1; };
  Estimate x = noisy(value, 0, 10);
  Estimate prior = x;
  for (Rgb<float>* image : {&prior.mean, &prior.half[0], &prior.half[1]})
    for (Plane<float>& plane : image->channel)
      for (float& v : plane.data) v *= 1.1f;
  const Plane<float> error = priorError(prior.mean, prior.half, x, x.variance, unbiasedError(x, x.variance));
  CHECK(error.at(30, 45) == doctest::Approx(1).epsilon(1e-3));
  CHECK(error.at(90, 45) == doctest::Approx(1e-4).epsilon(1e-2));
  // As it is, the box would lend 6 / 13 of the bright side's error to the dark pixels at the edge.
  CHECK(error.at(61, 45) < 0.01f);
  CHECK(error.at(61, 45) > 1e-4f);
}

}  // namespace braid::test_photon_map_shrinkage
