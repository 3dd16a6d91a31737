// SPDX-License-Identifier: Apache-2.0
// The environment: directions that are drawn against the density that is claimed.
#include <functional>

#include <doctest/doctest.h>

#include "renderer/scene/environment.h"
#include "tests/support/counts.h"

namespace braid::test_environment {

using test::Rng;

namespace {

// All tests of a case together raise a false alarm with this probability; the seeds are fixed.
constexpr double kFalseAlarm = 1e-3;

Vec3 randomDirection(Rng& rng) { return squareToUniformSphere(rng.next2()); }

EnvironmentData environmentImage(int width, int height, const std::function<Spectrum(int, int)>& color) {
  auto image = std::make_shared<Image>();
  image->width = width;
  image->height = height;
  image->channels = 3;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) image->floats.push_back(color(x, y)[c]);
  EnvironmentData data;
  data.image = image;
  data.radiance = Spectrum(1);
  return data;
}

struct EnvironmentTest {
  double pValue, integral;
};

// Chi-squared test over cells of latitude and longitude, four to a texel. Each cell's ∫ pdf dω is a midpoint rule of
// pdf sin θ, which is constant within a texel.
EnvironmentTest testEnvironment(const Environment& environment, const EnvironmentData& data, const Vec3& normal,
                                Rng& rng) {
  const int columns = 2 * data.image->width, rows = 2 * data.image->height, count = 60000;
  const float rotation = data.rotation;
  std::vector<double> expected(static_cast<size_t>(columns * rows)), observed(expected.size());
  EnvironmentTest result{0, 0};
  const double area = static_cast<double>(2 * kPi * kPi) / (columns * rows);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      // The image's centre lies at +X; longitude grows to its right, toward +Z.
      const float theta = kPi * (static_cast<float>(y) + 0.5f) / static_cast<float>(rows);
      const float phi = 2 * kPi * ((static_cast<float>(x) + 0.5f) / static_cast<float>(columns) - 0.5f) - rotation;
      const Vec3 w(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi));
      const double share = static_cast<double>(environment.pdfW(normal, w) * std::sin(theta)) * area;
      expected[static_cast<size_t>(y * columns + x)] = share * count;
      result.integral += share;
    }
  for (int i = 0; i < count; ++i) {
    Vec3 w;
    Spectrum radiance;
    if (!(environment.sample(normal, rng.next2(), w, radiance) > 0)) continue;
    const float turn = (std::atan2(w.z, w.x) + rotation) / (2 * kPi) + 0.5f;
    const int x = static_cast<int>((turn - std::floor(turn)) * static_cast<float>(columns));
    const int y = static_cast<int>(std::acos(std::clamp(w.y, -1.0f, 1.0f)) / kPi * static_cast<float>(rows));
    observed[static_cast<size_t>(std::min(y, rows - 1) * columns + std::min(x, columns - 1))] += 1;
  }
  result.pValue = test::pValueOf(observed, expected);
  return result;
}

}  // namespace

TEST_CASE("Environment images are sampled with the density that is stated") {
  Rng rng(8);
  constexpr int kTests = 7;
  const auto noise = [&](int, int) { return Spectrum(rng.next(), std::exp(4 * rng.next()), rng.next()); };
  const auto gradient = [](int x, int y) { return Spectrum(static_cast<float>(x + 4 * y)); };
  const auto sun = [](int x, int y) { return Spectrum(x == 11 && y == 5 ? 1e9f : 1.0f); };
  const auto half = [](int, int y) { return Spectrum(y < 4 ? 1.0f : 0.0f); };
  EnvironmentData cases[kTests] = {environmentImage(16, 8, noise),     environmentImage(16, 8, noise),
                                   environmentImage(24, 12, gradient), environmentImage(32, 16, sun),
                                   environmentImage(16, 8, half),      environmentImage(8, 4, noise),
                                   environmentImage(16, 8, noise)};
  cases[1].rotation = 1.2f;
  cases[6].base = 5;  // much of the image is even light, which is left to surfaces
  // Of any surface, at the poles, where longitude begins and ends, anywhere.
  const std::vector<Vec3> normals{
      Vec3(0), {0, 1, 0}, {0, -1, 0}, {-1, 0, 0}, randomDirection(rng), randomDirection(rng)};
  for (int i = 0; i < kTests; ++i) {
    CAPTURE(i);
    const Environment environment(cases[i]);
    for (const Vec3& normal : normals) {
      const EnvironmentTest result = testEnvironment(environment, cases[i], normal, rng);
      CAPTURE(normal.y);
      CHECK(result.integral == doctest::Approx(1).epsilon(1e-5));
      CHECK(result.pValue > test::sidak(kFalseAlarm, kTests * static_cast<int>(normals.size()) + 1));
    }
  }
  EnvironmentData constant;
  constant.radiance = Spectrum(2);
  const Environment sky(constant);
  const auto sample = [&](Rng& r) {
    Vec3 w;
    Spectrum radiance;
    return sky.sample(Vec3(0), r.next2(), w, radiance) > 0 ? std::optional<Vec3>(w) : std::nullopt;
  };
  const test::ChiSquared result = test::chiSquared(
      sample, [&](const Vec3& w) { return sky.pdfW(Vec3(0), w); }, 1);
  CHECK(result.integral == doctest::Approx(1).epsilon(1e-5));
  CHECK(result.pValue > test::sidak(kFalseAlarm, kTests * static_cast<int>(normals.size()) + 1));
}

TEST_CASE("For a surface, directions are drawn in proportion to radiance times cosine, within what blocks blur") {
  Rng rng(12);
  const Environment environment(environmentImage(64, 32, [](int x, int y) {
    return Spectrum((x - 20) * (x - 20) + (y - 9) * (y - 9) < 16 ? 30.0f : x > 40 ? 2.0f : 1.0f);
  }));
  for (int k = 0; k < 20; ++k) {
    const Vec3 normal = randomDirection(rng);
    for (int i = 0; i < 100; ++i) {
      Vec3 w;
      Spectrum radiance;
      if (!(environment.sample(normal, rng.next2(), w, radiance) > 0)) continue;
      CHECK(radiance.x == doctest::Approx(environment.radiance(w).x).epsilon(2e-3));
    }
    // Variance of L cos / pdf over its squared mean: what is left of the noise of light on a matte surface.
    const auto noise = [&](const Vec3& drawnFor) {
      double sum = 0, squares = 0;
      constexpr int kSamples = 20000;
      for (int i = 0; i < kSamples; ++i) {
        Vec3 w;
        Spectrum radiance;
        const float pdf = environment.sample(drawnFor, rng.next2(), w, radiance);
        const double v = pdf > 0 ? static_cast<double>(radiance.x * std::max(glm::dot(normal, w), 0.0f) / pdf) : 0;
        sum += v / kSamples;
        squares += v * v / kSamples;
      }
      return squares / (sum * sum) - 1;
    };
    CAPTURE(k);
    const double plain = noise(Vec3(0)), drawn = noise(normal);
    CHECK(drawn < 0.25 * plain);
    CHECK(drawn < 0.2);
  }
}

TEST_CASE("Every direction from which the environment shines can be drawn") {
  Rng rng(9);
  const Environment environment(
      environmentImage(16, 8, [&](int x, int y) { return Spectrum((x * 7 + y * 3) % 5 == 0 ? 1.0f : 0.0f); }));
  int missing = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3 w = randomDirection(rng);
    missing += luminance(environment.radiance(w)) > 0 &&
               !(environment.pdfW(Vec3(0), w) > 0 && environment.pdfW(randomDirection(rng), w) > 0);
  }
  CHECK(missing == 0);
}

TEST_CASE("A black environment is never drawn, and a rotated one turns about the vertical") {
  const Environment black(environmentImage(4, 2, [](int, int) { return Spectrum(0); }));
  Vec3 w;
  Spectrum radiance;
  CHECK(black.sample(Vec3(0), Vec2(0.3f), w, radiance) == 0);
  CHECK(black.pdfW(Vec3(0), {0, 1, 0}) == 0);
  EnvironmentData constant;
  CHECK(Environment(constant).sample(Vec3(0), Vec2(0.3f), w, radiance) == 0);

  EnvironmentData data =
      environmentImage(64, 32, [](int x, int y) { return Spectrum(x == 40 && y == 12 ? 1.0f : 0.0f); });
  const Environment still(data);
  data.rotation = 0.7f;
  const Environment turned(data);
  still.sample(Vec3(0), Vec2(0.5f), w, radiance);
  const Vec3 moved(glm::rotate(Mat4(1), 0.7f, Vec3(0, 1, 0)) * Vec4(w, 0));
  CHECK(luminance(still.radiance(w)) > 0);
  CHECK(turned.radiance(moved).x == doctest::Approx(still.radiance(w).x).epsilon(1e-3));
  CHECK(turned.pdfW(Vec3(0), moved) == doctest::Approx(still.pdfW(Vec3(0), w)).epsilon(1e-3));
}

TEST_CASE("An environment lies as in three.js and in Blender: its centre in +X, its right in +Z, its top in +Y") {
  const auto only = [](int column, int row) {
    return Environment(
        environmentImage(8, 4, [=](int x, int y) { return Spectrum(x == column && y == row ? 1.0f : 0.0f); }));
  };
  // The middle of texel (x, y) of 8 x 4: u = atan2(z, x) / 2 pi + 1/2, v = acos(y) / pi.
  const auto middle = [](int x, int y) {
    const float phi = 2 * kPi * ((static_cast<float>(x) + 0.5f) / 8 - 0.5f),
                theta = kPi * (static_cast<float>(y) + 0.5f) / 4;
    return Vec3(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi));
  };
  for (const auto& [x, y] : {std::pair(4, 1), std::pair(6, 2), std::pair(0, 0), std::pair(2, 3)}) {
    CHECK(only(x, y).radiance(middle(x, y)).x == doctest::Approx(1).epsilon(1e-4));
    CHECK(only(x, y).radiance(-middle(x, y)).x == 0);
  }
  // Half a texel around: bright between +X and +Z, right of the centre.
  CHECK(only(4, 2).radiance(glm::normalize(Vec3(1, -0.4f, 0.3f))).x > 0.5f);
  CHECK(only(5, 1).radiance(glm::normalize(Vec3(0.3f, 0.4f, 1))).x > 0.5f);
  CHECK(only(5, 1).radiance(glm::normalize(Vec3(0.3f, 0.4f, -1))).x == 0);
}

TEST_CASE(
    "A place in a texel stays there, however coarse floats are, and images of one bright row are sampled safely") {
  for (const size_t i : {size_t(0), size_t(1), size_t(22), size_t(899), size_t(4095), size_t(8191), size_t(65535)}) {
    CHECK(static_cast<size_t>(withinTexel(i, 0)) == i);
    CHECK(static_cast<size_t>(withinTexel(i, 0.5f)) == i);
    CHECK(static_cast<size_t>(withinTexel(i, kOneMinusEpsilon)) == i);
  }
  const Environment environment(environmentImage(8, 900, [](int, int y) { return Spectrum(y == 899 ? 1.0f : 0.0f); }));
  Rng rng(14);
  for (const Vec3& normal : {Vec3(0), Vec3(0, -1, 0), Vec3(std::nanf(""), 0, 1)})
    for (int i = 0; i < 50'000; ++i) {
      Vec3 w;
      Spectrum radiance;
      const float pdf = environment.sample(normal, rng.next2(), w, radiance);
      REQUIRE((pdf >= 0 && std::isfinite(pdf)));
    }
}

TEST_CASE("A sun of one texel takes almost all samples and its neighbourhood keeps the rest") {
  const Environment environment(
      environmentImage(256, 128, [](int x, int y) { return Spectrum(x == 90 && y == 40 ? 1e9f : 1.0f); }));
  Rng rng(10);
  double mean = 0;
  constexpr int kSamples = 20000;
  for (int i = 0; i < kSamples; ++i) {
    Vec3 w;
    Spectrum radiance;
    const float pdf = environment.sample(Vec3(0), rng.next2(), w, radiance);
    REQUIRE(pdf > 0);
    mean += static_cast<double>(average(radiance) / pdf) / kSamples;
  }
  // ∫ L over the sphere. Bilinear interpolation within texels of constant density: a standard deviation of about 1.
  CHECK(mean == doctest::Approx(static_cast<double>(4 * kPi * average(environment.average()))).epsilon(0.05));
}

}  // namespace braid::test_environment
