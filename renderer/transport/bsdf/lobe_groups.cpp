// SPDX-License-Identifier: Apache-2.0
// A BSDF without some of its lobes: what a photon map gathers, and what a path goes on with.
#include "renderer/transport/bsdf/bsdf.h"

namespace braid {

uint32_t Bsdf::broadLobes() const {
  uint32_t broad = kDiffuseLobes | (specular_.broad() ? SpecularLayer::kLobes : 0);
  covers_.upward([&](const auto& cover, size_t) {
    if (has(cover.kLobe) && cover.broad()) broad |= cover.kLobe;
  });
  return broad;
}

uint32_t Bsdf::lobeOf(size_t slot) {
  constexpr uint32_t kBase[kFirstCover] = {kLobeDiffuse, kLobeDiffuseTransmission, kLobeSpecular, 0};
  return slot < kFirstCover ? kBase[slot] : Covers::kLobe[slot - kFirstCover];
}

Bsdf::Probabilities Bsdf::restrictedTo(LobeGroup group, Probabilities p) const {
  const uint32_t broad = broadLobes();
  float total = 0;
  for (size_t slot = 0; slot < kSlots; ++slot) {
    if (((broad & lobeOf(slot)) != 0) != (group == LobeGroup::Broad)) p[slot] = 0;
    total += p[slot];
  }
  if (!(total > 0)) return Probabilities{};
  for (float& w : p) w /= total;
  return p;
}

float Bsdf::layersBroadShare() const {
  const uint32_t broad = broadLobes();
  // The sum of all is 1 up to rounding: what has one group only must say so exactly.
  float share = 0, rest = 0;
  const auto add = [&](bool always) {
    for (size_t slot = 0; slot < kSlots; ++slot)
      if (alwaysBroad(slot) == always) (broad & lobeOf(slot) ? share : rest) += select_[slot];
  };
  add(true);
  add(false);
  return share > 0 ? share / (share + rest) : 0.0f;
}

Bsdf Bsdf::restricted(LobeGroup group) const {
  Bsdf b = *this;
  if (group == LobeGroup::All || (diffuseOnly_ && group == LobeGroup::Broad)) return b;
  if (diffuseOnly_) {
    SurfaceParameters nothing;
    nothing.lobes = 0;
    b.initLayers(nothing, Transport::Radiance);
    return b;
  }
  const uint32_t broad = broadLobes();
  b.setScattering(group, lobes_ & (group == LobeGroup::Broad ? broad : ~broad));
  b.select_ = restrictedTo(group, select_);
  return b;
}

}  // namespace braid
