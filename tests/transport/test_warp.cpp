// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <doctest/doctest.h>

#include "renderer/transport/bsdf/warp.h"
#include "tests/support/statistics/chi_squared.h"

namespace braid::test_warp {

using test::Rng;

namespace {

constexpr int kPoints = 2000;

// Area (or solid angle) that the warp gives to a small square around u, by central differences in float.
template <class Warp>
double jacobian(const Warp& warp, const Vec2& u, float step) {
  const auto at = [&](float du, float dv) { return glm::dvec3(Vec3(warp(Vec2(u.x + du, u.y + dv)))); };
  const glm::dvec3 a = (at(step, 0) - at(-step, 0)) / (2.0 * double(step));
  const glm::dvec3 b = (at(0, step) - at(0, -step)) / (2.0 * double(step));
  return glm::length(glm::cross(a, b));
}

// Points that keep their distance from the borders and from the diagonals, where the concentric map has a kink.
Vec2 interiorPoint(Rng& rng) {
  for (;;) {
    const Vec2 u = 0.02f + 0.96f * rng.next2();
    if (std::fabs(u.x - u.y) > 0.01f && std::fabs(u.x + u.y - 1) > 0.01f && glm::length(u - 0.5f) > 0.02f) return u;
  }
}

template <class Warp, class Pdf, class Inverse>
void checkWarp(const Warp& warp, const Pdf& pdf, const Inverse& inverse, double scale = 1) {
  Rng rng(7);
  double worstJacobian = 0, worstInverse = 0;
  for (int i = 0; i < kPoints; ++i) {
    const Vec2 u = interiorPoint(rng);
    const Vec3 w(warp(u));
    worstJacobian = std::max(worstJacobian, std::fabs(jacobian(warp, u, 2e-3f) * double(pdf(w)) * scale - 1));
    worstInverse = std::max(worstInverse, double(glm::length(inverse(w) - u)));
  }
  CHECK(worstJacobian < 5e-3);
  CHECK(worstInverse < 1e-4);
}

}  // namespace

TEST_CASE("warp: sine and cosine are accurate to a float") {
  double worst = 0;
  for (int i = 0; i <= 100000; ++i) {
    const float u = static_cast<float>(i) * 1e-5f;
    const SinCos s = sinCosTurn(u);
    const double angle = 2 * 3.14159265358979323846 * double(u);
    worst = std::max({worst, std::fabs(double(s.sin) - std::sin(angle)), std::fabs(double(s.cos) - std::cos(angle))});
  }
  CHECK(worst < 2e-7);
}

TEST_CASE("warp: density times Jacobian is one, and the inverse inverts") {
  SUBCASE("disc") {
    checkWarp([](Vec2 u) { return Vec3(squareToDisc(u), 0); }, [](Vec3) { return discPdfA(); },
              [](Vec3 p) { return discToSquare(Vec2(p.x, p.y)); });
  }
  SUBCASE("cosine hemisphere") { checkWarp(squareToCosineHemisphere, cosineHemispherePdfW, cosineHemisphereToSquare); }
  SUBCASE("sphere") {
    checkWarp(
        squareToUniformSphere, [](Vec3) { return uniformSpherePdfW(); }, uniformSphereToSquare);
  }
  SUBCASE("hemisphere") { checkWarp(squareToUniformHemisphere, uniformHemispherePdfW, uniformHemisphereToSquare); }
  SUBCASE("triangle") {
    // Barycentrics span half the unit square.
    checkWarp([](Vec2 u) { return Vec3(squareToTriangle(u), 0); }, [](Vec3) { return trianglePdfA(0.5f); },
              [](Vec3 b) { return triangleToSquare(Vec2(b.x, b.y)); });
  }
  SUBCASE("cone") {
    for (const float opening : {1.5f, 0.3f, 1e-3f}) {
      checkWarp([=](Vec2 u) { return squareToCone(u, opening); }, [=](Vec3) { return conePdfW(opening); },
                [=](Vec3 w) { return coneToSquare(w, opening); });
    }
  }
}

TEST_CASE("warp: the cone keeps its precision down to the sun's size and below") {
  const float opening = 1e-8f;
  float widest = 0;
  Rng rng(11);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 w = squareToCone(rng.next2(), opening);
    widest = std::max(widest, std::sqrt(sqr(w.x) + sqr(w.y)));
  }
  CHECK(widest > 0.99f * std::sqrt(2 * opening));
  CHECK(widest <= 1.001f * std::sqrt(2 * opening));
}

TEST_CASE("warp: corners and edges of the square give usable points") {
  for (const float x : {0.0f, 0.5f, kOneMinusEpsilon}) {
    for (const float y : {0.0f, 0.5f, kOneMinusEpsilon}) {
      const Vec2 u(x, y);
      CHECK(glm::length(squareToDisc(u)) <= 1.000001f);
      for (const Vec3& w : {squareToCosineHemisphere(u), squareToUniformHemisphere(u)}) {
        CHECK(w.z > 0);
        CHECK(glm::length(w) == doctest::Approx(1).epsilon(1e-5));
      }
      CHECK(glm::length(squareToUniformSphere(u)) == doctest::Approx(1).epsilon(1e-5));
      const Vec2 b = squareToTriangle(u);
      CHECK(std::min({b.x, b.y, 1 - b.x - b.y}) >= -1e-6f);
    }
  }
}

TEST_CASE("warp: chi-squared of the hemisphere, sphere and cone warps") {
  const auto check = [](auto warp, auto pdf, uint64_t seed) {
    const auto result = test::chiSquared([&](Rng& rng) { return std::optional<Vec3>(warp(rng.next2())); }, pdf, seed);
    CHECK(result.pValue > test::sidak(1e-4, 4));
    CHECK(result.integral == doctest::Approx(1).epsilon(2e-3));
  };
  check(squareToCosineHemisphere, cosineHemispherePdfW, 1);
  check(squareToUniformHemisphere, uniformHemispherePdfW, 2);
  check(
      squareToUniformSphere, [](const Vec3&) { return uniformSpherePdfW(); }, 3);
  check([](Vec2 u) { return squareToCone(u, 0.2f); }, [](const Vec3& w) { return w.z > 0.8f ? conePdfW(0.2f) : 0.0f; },
        4);
}

TEST_CASE("warp: a wrong density is found") {
  const auto result =
      test::chiSquared([](Rng& rng) { return std::optional<Vec3>(squareToCosineHemisphere(rng.next2())); },
                       [](const Vec3& w) { return cosineHemispherePdfW(w) * (1 + 0.1f * w.x); }, 5);
  CHECK(result.pValue < 1e-4);
}

}  // namespace braid::test_warp
