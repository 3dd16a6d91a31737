// SPDX-License-Identifier: Apache-2.0
// Emissive triangles of the scene in world space, one record per triangle and placement, and the way from a hit to its
// record.
#pragma once

#include <cstdint>
#include <vector>

#include "renderer/core/vec.h"

namespace braid {

struct EmissiveTriangle {
  Vec3 p0, e1, e2;           // world: corner and two edges, metres
  Vec3 normal;               // unit, front side
  float area = 0;            // m²; of one that moves the mean over its steps, as what it sends in all
  Spectrum meanRadiance{0};  // of the front side, averaged over the triangle (textures, coverage)
  uint32_t mesh = 0, triangle = 0, instance = 0;
  bool twoSided = false;
  bool textured = false;  // radiance or coverage varies over the triangle
  bool moves = false;     // its shape is that at the shutter's opening; Scene::emitterAt() has others

  // Radiant power in W, luminance-free channel average.
  float power() const { return average(meanRadiance) * area * kPi * (twoSided ? 2.0f : 1.0f); }
};

}  // namespace braid
