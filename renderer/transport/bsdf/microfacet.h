// SPDX-License-Identifier: Apache-2.0
// The GGX (Trowbridge-Reitz) microfacet distribution, isotropic and anisotropic. Directions are unit, in the frame of
// the distribution (z = normal, x = direction of alphaX), and lie on the upper side.
#pragma once

#include <algorithm>
#include <cmath>

#include "renderer/core/vec.h"
#include "renderer/scene/data/material.h"
#include "renderer/transport/bsdf/warp.h"

namespace braid {

struct Ggx {
  // Below this alpha a surface is a mirror: float half vectors no longer resolve the lobe.
  static constexpr float kMinAlpha = kSmoothAlpha;

  float alphaX, alphaY;

  // Length of (alphaX·x, alphaY·y, z). With it Smith's terms need no division by cosines:
  // 1 + Lambda(w) = (z + stretch) / (2 z)   (Heitz 2014, "Understanding the Masking-Shadowing Function", eq. 72, 86).
  float stretch(const Vec3& w) const { return std::sqrt(sqr(alphaX * w.x) + sqr(alphaY * w.y) + sqr(w.z)); }

  // Normal distribution (Walter et al. 2007 eq. 33; Burley 2012 for two alphas).
  // TRAP: the textbook cos²(alpha² - 1) + 1 cancels for small alpha; dividing the tangent by alpha does not.
  float D(const Vec3& h) const {
    const float e = sqr(h.x / alphaX) + sqr(h.y / alphaY) + sqr(h.z);
    return kInvPi / (alphaX * alphaY * sqr(e));
  }

  // Smith masking of one direction.
  static float G1(float cosW, float stretchW) { return 2 * cosW / (cosW + stretchW); }

  // Height-correlated masking-shadowing over 4 cosO cosI (Heitz 2014 eq. 99).
  static float visibility(float cosO, float stretchO, float cosI, float stretchI) {
    return 0.5f / (cosI * stretchO + cosO * stretchI);
  }

  // Density of visible normals over VdotH: D·G1 / cosO (Heitz 2014 eq. 16). Reflection divides by another 4,
  // refraction multiplies by VdotH and its own Jacobian.
  static float visibleNormals(float d, float cosO, float stretchO) { return 2 * d / (cosO + stretchO); }

  // A visible normal (Dupuy & Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps").
  Vec3 sampleVisibleNormal(const Vec3& wo, float stretchO, const Vec2& u) const {
    const Vec3 v = Vec3(alphaX * wo.x, alphaY * wo.y, wo.z) * (1 / stretchO);
    const float z = (1 - u.y) * (1 + v.z) - v.z;
    const float r = safeSqrt((1 - z) * (1 + z));
    const SinCos t = sinCosTurn(u.x);
    const Vec3 h = Vec3(r * t.cos, r * t.sin, z) + v;
    // TRAP: h vanishes when the cap point is opposite v, at u.y = 1 exactly; the floor stands for the rim.
    return glm::normalize(Vec3(alphaX * h.x, alphaY * h.y, std::max(h.z, 1e-7f)));
  }
};

}  // namespace braid
