// SPDX-License-Identifier: Apache-2.0
// Tone curves against their published values, and automatic exposure over twelve orders of magnitude of light.
#include <limits>

#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "renderer/film/files/picture.h"
#include "renderer/core/image_values.h"
#include "tests/support/command_line.h"

namespace braid::test_tone {

using test::braidRun;
using test::contains;
using test::Folder;
using test::readText;

namespace {

Vec3 linearDisplay(ToneCurve curve, const Vec3& c) {
  const Vec3 shown = toDisplay(curve, c);
  return {decodeSrgb(shown.x), decodeSrgb(shown.y), decodeSrgb(shown.z)};
}

// A ramp of `stops` stops below `most`, as noisy images have: in no order.
Rgb<float> ramp(float most, float stops) {
  Rgb<float> image(64, 64);
  for (size_t i = 0; i < image.size(); ++i)
    image.set(i, Vec3(most * std::exp2(-stops * static_cast<float>(i * 1237 % 4096) / 4095)));
  return image;
}

float meanShown(const Rgb<float>& image, const Tone& tone) {
  float sum = 0;
  const std::vector<uint8_t> bytes = toneMapped(image, nullptr, tone);
  for (const uint8_t b : bytes) sum += static_cast<float>(b) / 255;
  return sum / static_cast<float>(bytes.size());
}

}  // namespace

TEST_CASE("PBR Neutral: the values of Khronos' specification") {
  const auto at = [](float r, float g, float b) { return linearDisplay(ToneCurve::Neutral, Vec3(r, g, b)); };
  // Below 2 F90: x - (x - x² / 4 F90); above it: x - F90, up to Ks = 0.76.
  CHECK(at(0.04f, 0.04f, 0.04f).x == doctest::Approx(0.01).epsilon(1e-3));
  CHECK(at(0.08f, 0.08f, 0.08f).x == doctest::Approx(0.04).epsilon(1e-3));
  CHECK(at(0.18f, 0.18f, 0.18f).x == doctest::Approx(0.14).epsilon(1e-4));
  CHECK(at(0.8f, 0.8f, 0.8f).x == doctest::Approx(0.76).epsilon(1e-4));
  const Vec3 colour = at(0.7f, 0.5f, 0.3f);  // as it is, but for F90
  CHECK(colour.x == doctest::Approx(0.66).epsilon(1e-4));
  CHECK(colour.y == doctest::Approx(0.46).epsilon(1e-4));
  CHECK(colour.z == doctest::Approx(0.26).epsilon(1e-4));
  // p = 0.96: p_n = 1 - 0.24² / (p + 1 - 1.52); greys stay grey.
  CHECK(at(1, 1, 1).y == doctest::Approx(1 - 0.0576 / 0.44).epsilon(1e-4));
  // Red of 4: p = 4, p_n = 1 - 0.0576 / 3.48, g = 1 / (0.15 (p - p_n) + 1).
  const double top = 1 - 0.0576 / 3.48, g = 1 / (0.15 * (4 - top) + 1);
  const Vec3 red = at(4, 0, 0);
  CHECK(red.x == doctest::Approx(top).epsilon(1e-4));
  CHECK(red.y == doctest::Approx(top * (1 - g)).epsilon(1e-3));
  CHECK(at(1e30f, 1e30f, 1e30f).x == doctest::Approx(1).epsilon(1e-4));
}

TEST_CASE("AgX: the entries of AgX_Default_Contrast.spi1d") {
  // Index of 4096 entries between 2^-12.47393 and 2^4.026069, and the value there.
  const std::pair<int, double> published[] = {{512, 0.0111792},  {1024, 0.0390305}, {1536, 0.1154386},
                                              {2048, 0.2928964}, {2482, 0.5000888}, {3072, 0.7776929},
                                              {3584, 0.9361831}};
  for (const auto& [index, value] : published) {
    const double stimulus = std::exp2(-12.47393 + (4.026069 + 12.47393) * index / 4095);
    // The first row of the matrix does not quite sum to 1.
    const auto grey = static_cast<float>(stimulus / (0.842479062253094 + 0.0784335999999992 + 0.0792237451477643));
    CAPTURE(index);
    CHECK(toDisplay(ToneCurve::Agx, Vec3(grey)).x == doctest::Approx(value).epsilon(1e-4).scale(0.05));
  }
  CHECK(toDisplay(ToneCurve::Agx, Vec3(1e30f)).y == doctest::Approx(1).epsilon(1e-4));
  // Bright saturated colours lose their saturation.
  const Vec3 red = toDisplay(ToneCurve::Agx, Vec3(16, 0, 0));
  CHECK(red.y > 0.6f);
}

TEST_CASE("ACES: Hill's fit, which shows middle grey as the standard does: 4.8 of 48 nits") {
  const auto at = [](float v) { return linearDisplay(ToneCurve::Aces, Vec3(v)); };
  CHECK(at(0.18f).y == doctest::Approx(0.1).epsilon(0.06));
  const auto fit = [](double v) {
    return (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081);
  };
  for (const float v : {0.01f, 0.18f, 0.5f, 1.0f, 4.0f}) CHECK(at(v).y == doctest::Approx(fit(v)).epsilon(2e-3));
  CHECK(at(1e30f) == Vec3(1));
  CHECK(at(0).y < 1e-3f);
}

TEST_CASE("No curve: cut off at 1; what is no colour is black under every curve") {
  CHECK(linearDisplay(ToneCurve::None, Vec3(0.5f, 7, -1)).x == doctest::Approx(0.5).epsilon(1e-4));
  CHECK(toDisplay(ToneCurve::None, Vec3(0.5f, 7, -1)).y == doctest::Approx(1).epsilon(1e-5));
  CHECK(toDisplay(ToneCurve::None, Vec3(0.5f, 7, -1)).z == 0);
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
  for (const ToneCurve curve : {ToneCurve::Neutral, ToneCurve::Agx, ToneCurve::Aces, ToneCurve::None}) {
    CHECK(toDisplay(curve, Vec3(nan)) == toDisplay(curve, Vec3(0)));
    CHECK(toDisplay(curve, Vec3(-5)) == toDisplay(curve, Vec3(0)));
    CHECK(toDisplay(curve, Vec3(infinite)).x > 0.99f);
    float before = -1;  // rises all the way
    for (float v = 1e-4f; v < 1e4f; v *= 1.1f) {
      const float now = toDisplay(curve, Vec3(v)).y;
      CHECK(now >= before - 1e-6f);
      before = now;
    }
  }
}

TEST_CASE("Automatic exposure shows the same picture from 10⁻⁶ to 10⁶") {
  const Rgb<float> one = ramp(1, 4);
  const float expected = meanShown(one, toneFor({}, one));
  CHECK(expected > 0.3f);
  CHECK(expected < 0.6f);
  for (float light = 1e-6f; light < 2e6f; light *= 10) {
    const Rgb<float> image = ramp(light, 4);
    CAPTURE(light);
    CHECK(meanShown(image, toneFor({}, image)) == doctest::Approx(expected).epsilon(0.02));
  }
  // The log-average of a ramp of four stops below 1 is 1/4, which 0.18 lies 0.47 stops below.
  CHECK(autoExposure(one) == doctest::Approx(-0.47).epsilon(0.1));
}

TEST_CASE("Automatic exposure: what is black, background or a firefly does not count; highlights stay") {
  Rgb<float> image = ramp(1, 4);
  const float plain = autoExposure(image);
  for (size_t i = 0; i < image.size(); i += 100) image.set(i, Vec3(1e8f));
  CHECK(autoExposure(image) == doctest::Approx(plain).epsilon(0.15));
  Rgb<float> half = ramp(1, 4);
  Plane<float> alpha(64, 64, 1.0f);
  for (size_t i = 0; i < half.size(); ++i)
    if (i % 64 < 32) {
      half.set(i, Vec3(100));
      alpha[i] = 0;
    }
  CHECK(autoExposure(half, &alpha) == doctest::Approx(plain).epsilon(0.15));
  for (size_t i = 0; i < half.size(); ++i)
    if (i % 64 < 32) half.set(i, Vec3(0));
  CHECK(autoExposure(half) == doctest::Approx(plain).epsilon(0.15));
  CHECK(autoExposure(Rgb<float>(4, 4)) == 0);
  // A fifth of the image a hundred times brighter than the dark rest: it is not burnt.
  Rgb<float> window(10, 10, 0.01f);
  for (size_t i = 0; i < 20; ++i) window.set(i, Vec3(1));
  CHECK(autoExposure(window) < 0.1f);
  CHECK(toneFor({ToneCurve::Agx, 2.5}, window).exposureStops == 2.5f);
}

TEST_CASE("Pictures are exposed by themselves, told so, and the same for lamps of a candle and of a thousand suns") {
  const Folder folder;
  const std::string render = "render '" BRAID_SOURCE_DIR "/scenes/cornell.glb' --size 32x24 --spp 8 --integrator pt ";
  std::vector<float> means;
  for (const char* scale : {"0.001", "1", "1000"}) {
    const test::Run run = braidRun(folder, render + "--combine none -o a.png --light-scale " + scale);
    REQUIRE(run.code == 0);
    CHECK(contains(run.err, "shown with --tone neutral --exposure "));
    const Rgb<float> shown = readImage(folder.path / "a.png").rgb();
    float sum = 0;
    for (size_t i = 0; i < shown.size(); ++i) sum += shown[1][i] / static_cast<float>(shown.size());
    means.push_back(sum);
  }
  CHECK(means[0] == doctest::Approx(means[1]).epsilon(0.02));
  CHECK(means[2] == doctest::Approx(means[1]).epsilon(0.02));
  CHECK(means[1] > 0.08f);
  CHECK(means[1] < 0.5f);
  // Linear files stay as they are.
  REQUIRE(braidRun(folder, render + "--combine none --reproducible -o a.exr").code == 0);
  REQUIRE(braidRun(folder, render + "--combine none --reproducible -o b.exr --exposure 3 --tone agx").code == 0);
  CHECK((readText(folder.path / "a.exr") == readText(folder.path / "b.exr")));
  CHECK(braidRun(folder, render + "-o c.png --tone reinhard").code == 1);
}

}  // namespace braid::test_tone
