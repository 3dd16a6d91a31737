// SPDX-License-Identifier: Apache-2.0
// Pixels that are not finite have no weight in any method: they are filled from the other half or their neighbours.
#include <limits>

#include <doctest/doctest.h>

#include "combiners/pipeline/invalid_pixels.h"
#include "tests/support/every_method.h"

namespace braid::test_invalid_pixels {

using namespace test;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

bool allFinite(const Rgb<float>& image) {
  for (size_t c = 0; c < 3; ++c)
    for (const float v : image[c].data)
      if (!std::isfinite(v)) return false;
  return true;
}

Rgb<float> ramp(int width, int height) {
  Rgb<float> image(width, height);
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) image[c].at(x, y) = static_cast<float>(1 + x + 10 * y) + static_cast<float>(c);
  return image;
}

// Makes the pixel of every plane of the estimate invalid.
void spoil(Estimate& e, size_t i, float value) {
  for (Rgb<float>* image :
       {&e.mean, &e.half[0], &e.half[1], &e.variance, &e.bias, &e.biasHalf[0], &e.biasHalf[1], &e.biasVariance})
    if (!image->empty()) image->set(i, Vec3(value));
  for (Rgb<float>& q : e.quarter) q.set(i, Vec3(value));
}

}  // namespace

TEST_CASE("Invalid pixels: neighbours fill holes, coarser images fill gaps, valid pixels stay") {
  const Rgb<float> given = ramp(9, 7);
  Rgb<float> image = given;
  image[1].at(4, 3) = kInfinity;
  image[0].at(0, 0) = kNaN;
  CHECK(fillInvalid(image) == 2);
  for (size_t c = 0; c < 3; ++c) {
    CHECK(image[c].at(4, 3) == doctest::Approx(given[c].at(4, 3)));  // the mean of eight on a slope
    CHECK(image[c].at(0, 0) == doctest::Approx((given[c].at(1, 0) + given[c].at(0, 1) + given[c].at(1, 1)) / 3));
  }
  CHECK(image[2].at(5, 5) == given[2].at(5, 5));
  CHECK(fillInvalid(image) == 0);

  Rgb<float> gap = ramp(64, 32);
  for (int y = 4; y < 28; ++y)
    for (int x = 8; x < 56; ++x) gap[2].at(x, y) = -kInfinity;
  CHECK(fillInvalid(gap) == 24 * 48);
  CHECK(allFinite(gap));
  CHECK(gap[0].at(32, 16) > 1 + 7 + 30);  // between the borders of the gap
  CHECK(gap[0].at(32, 16) < 1 + 56 + 280);

  Plane<float> nothing(5, 3, kNaN);
  CHECK(fillInvalid(nothing) == 15);
  CHECK(nothing.at(2, 1) == 0);
  Plane<float> one(1, 1, kNaN);
  CHECK(fillInvalid(one) == 1);
  CHECK(one[0] == 0);
}

TEST_CASE("Invalid pixels: what one half has, the other gets, and the mean follows") {
  Case c = makeCase(sized(12, 9));
  Estimate e = c.pt();
  const Vec3 b = e.half[1].pixel(40);
  e.mean.set(40, Vec3(kNaN));
  e.half[0][2][40] = kInfinity;
  e.quarter[0].set(40, Vec3(kNaN));
  e.variance[0][40] = kNaN;
  CHECK(fillInvalid(e) == 1);
  CHECK(e.half[0].pixel(40) == b);
  CHECK(e.mean.pixel(40) == b);
  CHECK(e.quarter[0].pixel(40) == b);
  CHECK(std::isfinite(e.variance[0][40]));
  CHECK(e.variance[0][40] > 0);
  CHECK(e.half[0].pixel(41) == c.pt().half[0].pixel(41));
}

TEST_CASE("Invalid pixels: features are filled in their midst and 0 where there is nothing") {
  Case c = makeCase(sized(12, 9));
  Estimates all = c.estimates;
  Features& f = *all.features;
  f.depth.mean.at(5, 4) = kNaN;
  for (int x = 0; x < 12; ++x)
    for (int y = 0; y < 3; ++y) f.depth.mean.at(x, y) = kInfinity;
  CHECK(fillInvalid(all) == 0);
  CHECK(f.depth.mean.at(5, 4) > 1);
  CHECK(f.depth.mean.at(5, 1) == 0);
  CHECK(f.depth.mean.at(0, 2) == 0);
}

TEST_CASE("Invalid pixels: no method makes a hole of them") {
  const Case c = makeCase(sized(48, 36));
  const Estimates clean = everything(c);
  const size_t at = clean.estimates[0].mean[0].index(20, 30);
  for (const auto& m : runnableMethods()) {
    const std::string name = m->name();
    CAPTURE(name);
    const Rgb<float> wanted = outputOf(*m, clean).result.image.mean;
    for (const float value : {kNaN, kInfinity}) {
      Estimates bad = clean;
      for (Estimate& e : bad.estimates) spoil(e, at, value);
      bad.estimates[0].half[1] = clean.estimates[0].half[1];  // pt still has one half of the pixel
      const PipelineOutput out = outputOf(*m, bad);
      REQUIRE(out.ran());
      CHECK(allFinite(out.result.image.mean));
      // The pixel lies in a smooth part of the picture: its neighbours' light, within the noise.
      double before = 0, after = 0;
      for (size_t k = 0; k < 3; ++k) {
        before += static_cast<double>(wanted[k][at]);
        after += static_cast<double>(out.result.image.mean[k][at]);
      }
      double around = 0;
      for (const int x : {18, 19, 21, 22})
        for (size_t k = 0; k < 3; ++k) around += static_cast<double>(wanted[k].at(x, 30)) / 4;
      CHECK(after > 0.2 * std::min(before, around));
      CHECK(after < 5 * std::max(before, around));
    }
  }
}

TEST_CASE("Invalid pixels: the pipeline counts them, and changes nothing else") {
  const Case c = makeCase(sized(24, 18));
  Estimates bad = c.estimates;
  spoil(bad.estimates[0], 100, kNaN);
  const PipelineResult result = runPipeline(bad, {"nlm"}, {});
  CHECK(result.sanitised.nonFinite > 0);
  CHECK(result.sanitised.filled == 1);
  const PipelineResult good = runPipeline(c.estimates, {"nlm"}, {});
  CHECK(good.sanitised.clean());
  // The same as if the file had been filled before.
  Estimates filled = bad;
  fillInvalid(filled);
  CHECK(identical(runPipeline(filled, {"nlm"}, {}).find("nlm")->result.image.mean,
                  result.find("nlm")->result.image.mean));
}

}  // namespace braid::test_invalid_pixels
