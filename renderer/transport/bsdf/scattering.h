// SPDX-License-Identifier: Apache-2.0
// What a BSDF and its lobes answer.
#pragma once

#include <cstdint>

#include "renderer/core/vec.h"

namespace braid {

struct BsdfValue {
  Spectrum f{0};      // BSDF · |cos(wi, shading normal)|; delta lobes excluded
  float pdfW = 0;     // solid-angle density with which sample() picks wi given wo; delta lobes excluded
  float pdfRevW = 0;  // the same with the roles of wo and wi exchanged; filled only when asked for
};

struct BsdfSample {
  Vec3 wi{0, 0, 1};
  Spectrum weight{0};  // f · |cos| / pdf of the whole lobe set (non-delta), or of the delta lobe alone; never negative
  float pdfW = 0;      // density of the whole lobe set; for a delta lobe the discrete probability of picking it
  bool delta = false;
  bool transmitted = false;  // wi is on the other side of the surface than wo
  bool straight = false;     // delta, along -wo through a pane: no event, whatever wi says below a shading horizon
};

// What travels from wi to wo: radiance on paths from the eye, importance's dual on paths from a light.
// Radiance changes by 1/eta² when it crosses into a denser medium, power does not (Veach 1997, section 5.2).
enum class Transport : uint8_t { Radiance, Power };

// Lobes by what a photon map can do for them. Broad: diffuse, diffuse transmission, sheen, and GGX lobes with alpha of
// at least kBroadAlpha: few photons do. Narrow: the rest, where next to no photon would come from the lobe.
enum class LobeGroup : uint8_t { All, Broad, Narrow };
inline constexpr float kBroadAlpha = 0.3f;

inline bool anyPositive(const Spectrum& s) { return s.x > 0 || s.y > 0 || s.z > 0; }

}  // namespace braid
