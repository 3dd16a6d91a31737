// SPDX-License-Identifier: Apache-2.0
// Maps from the unit square to the domains that are sampled, each with its density and its inverse. All are continuous
// almost everywhere and one to one, so stratified or correlated points stay so on the target.
#pragma once

#include <algorithm>
#include <cmath>

#include "renderer/core/vec.h"

namespace braid {

inline constexpr float kTwoPi = 2 * kPi;
inline constexpr float kInvTwoPi = 0.5f * kInvPi;
inline constexpr float kInvFourPi = 0.25f * kInvPi;

struct SinCos {
  float sin, cos;
};

// Taylor polynomials of degree 9 and 8 on [-pi/4, pi/4]: error below 3e-8 there, less than half a float ulp near 1.
// Plain arithmetic, so that the compiler vectorises it and every platform rounds alike.
inline SinCos sinCosQuarter(float x) {
  const float x2 = x * x;
  const float s = x + x * x2 * (-1.0f / 6 + x2 * (1.0f / 120 + x2 * (-1.0f / 5040 + x2 * (1.0f / 362880))));
  const float c = 1 + x2 * (-0.5f + x2 * (1.0f / 24 + x2 * (-1.0f / 720 + x2 * (1.0f / 40320))));
  return {s, c};
}

// sin and cos of 2 pi u for u in [0, 1].
inline SinCos sinCosTurn(float u) {
  const float quarters = 4 * u;
  const int k = static_cast<int>(quarters + 0.5f);
  const SinCos r = sinCosQuarter((quarters - static_cast<float>(k)) * (0.5f * kPi));
  const float s = (k & 1) ? r.cos : r.sin;
  const float c = (k & 1) ? r.sin : r.cos;
  return {(k & 2) ? -s : s, ((k + 1) & 2) ? -c : c};
}

// The angle of (x, y) as a fraction of a turn in [0, 1).
inline float turnOf(float x, float y) {
  const float turn = std::atan2(y, x) * kInvTwoPi;
  return std::min(turn < 0 ? turn + 1 : turn, kOneMinusEpsilon);
}

// --- Unit disc: Shirley & Chiu 1997, "A Low Distortion Map Between Disk and Square" ---

inline Vec2 squareToDisc(const Vec2& u) {
  const float a = 2 * u.x - 1, b = 2 * u.y - 1;
  const bool wide = std::fabs(a) > std::fabs(b);
  const float r = select(wide, a, b);
  const float other = select(wide, b, a);
  // TRAP: the centre of the square has no angle; any angle will do, 0/0 will not.
  const SinCos t = sinCosQuarter(r != 0 ? (0.25f * kPi) * (other / r) : 0.0f);
  return r * Vec2(select(wide, t.cos, t.sin), select(wide, t.sin, t.cos));
}

inline float discPdfA() { return kInvPi; }

inline Vec2 discToSquare(const Vec2& p) {
  const bool wide = std::fabs(p.x) > std::fabs(p.y);
  const float major = wide ? p.x : p.y, minor = wide ? p.y : p.x;
  if (major == 0) return Vec2(0.5f);
  const float r = std::copysign(glm::length(p), major);
  const float other = r * (std::atan(minor / major) * (4 * kInvPi));
  return 0.5f * (wide ? Vec2(r, other) : Vec2(other, r)) + 0.5f;
}

// --- Hemisphere about +z with density cos / pi: Malley's method over the concentric map ---

inline Vec3 squareToCosineHemisphere(const Vec2& u) {
  const Vec2 p = squareToDisc(u);
  // TRAP: on the rim z would be 0 and so would the density; the floor keeps the sample usable.
  return Vec3(p, std::sqrt(std::max(1 - glm::dot(p, p), 1e-12f)));
}

inline float cosineHemispherePdfW(const Vec3& w) { return w.z > 0 ? w.z * kInvPi : 0.0f; }

inline Vec2 cosineHemisphereToSquare(const Vec3& w) { return discToSquare(Vec2(w.x, w.y)); }

// --- Uniform sphere and hemisphere: Archimedes' equal-area cylinder ---

inline Vec3 squareToUniformSphere(const Vec2& u) {
  const float z = 1 - 2 * u.x;
  const float r = 2 * safeSqrt(u.x * (1 - u.x));
  const SinCos t = sinCosTurn(u.y);
  return Vec3(r * t.cos, r * t.sin, z);
}

inline float uniformSpherePdfW() { return kInvFourPi; }

inline Vec2 uniformSphereToSquare(const Vec3& w) { return Vec2(0.5f * (1 - w.z), turnOf(w.x, w.y)); }

inline Vec3 squareToUniformHemisphere(const Vec2& u) {
  const float z = 1 - u.x;
  const float r = safeSqrt(u.x * (2 - u.x));
  const SinCos t = sinCosTurn(u.y);
  return Vec3(r * t.cos, r * t.sin, std::max(z, 1e-6f));
}

inline float uniformHemispherePdfW(const Vec3& w) { return w.z > 0 ? kInvTwoPi : 0.0f; }

inline Vec2 uniformHemisphereToSquare(const Vec3& w) { return Vec2(1 - w.z, turnOf(w.x, w.y)); }

// --- Cone about +z. The opening is given as 1 - cos(half angle) ---
// TRAP: cos of a narrow cone (the sun: 1 - 1e-5) leaves few bits of the opening; callers pass 1 - cos computed from
// sin.

inline Vec3 squareToCone(const Vec2& u, float oneMinusCosMax) {
  const float x = u.x * oneMinusCosMax;
  const float r = safeSqrt(x * (2 - x));
  const SinCos t = sinCosTurn(u.y);
  return Vec3(r * t.cos, r * t.sin, 1 - x);
}

inline float conePdfW(float oneMinusCosMax) { return kInvTwoPi / oneMinusCosMax; }

inline Vec2 coneToSquare(const Vec3& w, float oneMinusCosMax) {
  // 1 - cos = sin² / (1 + cos) keeps the digits of narrow cones.
  const float x = w.z > 0 ? (sqr(w.x) + sqr(w.y)) / (1 + w.z) : 1 - w.z;
  return Vec2(std::min(x / oneMinusCosMax, kOneMinusEpsilon), turnOf(w.x, w.y));
}

// --- Triangle: barycentric weights of the second and third vertex, uniform in area (Heitz 2019, "A Low-Distortion Map
// Between Triangle and Square") ---

inline Vec2 squareToTriangle(const Vec2& u) {
  const bool upper = u.y > u.x;
  const float half = 0.5f * select(upper, u.x, u.y);
  return Vec2(select(upper, half, u.x - half), select(upper, u.y - half, half));
}

inline float trianglePdfA(float area) { return 1 / area; }

inline Vec2 triangleToSquare(const Vec2& b) {
  const Vec2 u = b.y > b.x ? Vec2(2 * b.x, b.x + b.y) : Vec2(b.x + b.y, 2 * b.y);
  return glm::min(u, Vec2(kOneMinusEpsilon));
}

}  // namespace braid
