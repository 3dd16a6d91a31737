// SPDX-License-Identifier: Apache-2.0
// Vectors, colours and shading frames. Positions in metres; radiance in W·sr⁻¹·m⁻², linear Rec. 709 primaries.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include <glm/glm.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>

// For short functions of vectors: called, they pass them through memory, and whoever then reads eight floats at once
// waits until the single ones have left the store buffer.
#define BRAID_INLINE [[gnu::always_inline]] inline

namespace braid {

using Vec2 = glm::vec2;
using Vec3 = glm::vec3;
using Vec4 = glm::vec4;
using Mat3 = glm::mat3;
using Mat4 = glm::mat4;
using Quat = glm::quat;

// Linear RGB radiance, reflectance or throughput.
using Spectrum = glm::vec3;

inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kInvPi = 0.31830988618379067154f;
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();
// The largest float below 1: keeps a uniform variate in [0, 1).
inline constexpr float kOneMinusEpsilon = 0x1.fffffep-1f;

template <class T>
constexpr T sqr(T x) {
  return x * x;
}

// c ? a : b without a branch: for choices that random numbers make, which no predictor learns.
inline float select(bool c, float a, float b) {
  const uint32_t mask = 0u - static_cast<uint32_t>(c);
  return std::bit_cast<float>((std::bit_cast<uint32_t>(a) & mask) | (std::bit_cast<uint32_t>(b) & ~mask));
}

// sqrt that treats small negative rounding errors as zero.
inline float safeSqrt(float x) { return std::sqrt(x > 0 ? x : 0.0f); }

// |v| by component, without the branches of glm::abs.
inline Vec3 magnitudes(const Vec3& v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }

inline float maxComponent(const Vec3& v) { return glm::max(v.x, glm::max(v.y, v.z)); }
inline float minComponent(const Vec3& v) { return glm::min(v.x, glm::min(v.y, v.z)); }
inline float average(const Vec3& v) { return (v.x + v.y + v.z) * (1.0f / 3.0f); }
inline float luminance(const Spectrum& s) { return 0.2126f * s.x + 0.7152f * s.y + 0.0722f * s.z; }
inline bool isBlack(const Spectrum& s) { return s.x == 0 && s.y == 0 && s.z == 0; }
inline bool isFinite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

// Makes a vector unit that is already so but for rounding: one Newton step, no square root.
inline Vec3 renormalize(const Vec3& v) { return v * (1.5f - 0.5f * glm::dot(v, v)); }

// An orthonormal basis whose z axis is the normal `n`.
struct Frame {
  Vec3 s{1, 0, 0}, t{0, 1, 0}, n{0, 0, 1};

  Frame() = default;
  Frame(const Vec3& tangent, const Vec3& bitangent, const Vec3& normal) : s(tangent), t(bitangent), n(normal) {}

  // Branchless basis from a unit normal (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
  BRAID_INLINE explicit Frame(const Vec3& normal) : n(normal) {
    const float sign = std::copysign(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float b = n.x * n.y * a;
    s = Vec3(1 + sign * sqr(n.x) * a, sign * b, -sign * n.x);
    t = Vec3(b, sign + sqr(n.y) * a, -n.y);
  }

  BRAID_INLINE Vec3 toLocal(const Vec3& v) const { return Vec3(glm::dot(v, s), glm::dot(v, t), glm::dot(v, n)); }
  BRAID_INLINE Vec3 toWorld(const Vec3& v) const { return s * v.x + t * v.y + n * v.z; }
};

// Axis-aligned bounding box; empty when lo > hi.
struct Bounds {
  Vec3 lo{kInfinity, kInfinity, kInfinity};
  Vec3 hi{-kInfinity, -kInfinity, -kInfinity};

  bool empty() const { return !(lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z); }
  void extend(const Vec3& p) {
    lo = glm::min(lo, p);
    hi = glm::max(hi, p);
  }
  void extend(const Bounds& b) {
    lo = glm::min(lo, b.lo);
    hi = glm::max(hi, b.hi);
  }
  Vec3 centre() const { return 0.5f * lo + 0.5f * hi; }
  Vec3 diagonal() const { return empty() ? Vec3(0) : hi - lo; }
};

}  // namespace braid
