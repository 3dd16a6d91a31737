// SPDX-License-Identifier: Apache-2.0
// A BSDF without some of its lobes: what a photon map gathers, and what a path goes on with.
#include <algorithm>

#include "renderer/transport/bsdf/bsdf.h"

namespace braid {

uint32_t Bsdf::broadLobes() const {
  uint32_t broad = kLobeDiffuse | kLobeDiffuseTransmission | kLobeSheen;
  const bool specular = has(kLobeSpecular | kLobeTransmission);
  if (specular && !smooth_ && std::min(ggx_.alphaX, ggx_.alphaY) >= kBroadAlpha)
    broad |= kLobeSpecular | kLobeTransmission;
  if (has(kLobeClearcoat) && !clearcoatSmooth_ && clearcoatGgx_.alphaX >= kBroadAlpha) broad |= kLobeClearcoat;
  return broad;
}

Bsdf::Selection Bsdf::restrictedTo(LobeGroup group, Selection s) const {
  const uint32_t broad = broadLobes();
  const auto keep = [&](float& probability, uint32_t lobe) {
    if (((broad & lobe) != 0) != (group == LobeGroup::Broad)) probability = 0;
  };
  keep(s.diffuse, kLobeDiffuse);
  keep(s.diffuseTransmission, kLobeDiffuseTransmission);
  keep(s.specular, kLobeSpecular);
  keep(s.passThrough, 0);
  keep(s.sheen, kLobeSheen);
  keep(s.clearcoat, kLobeClearcoat);
  const float total = s.diffuse + s.diffuseTransmission + s.specular + s.passThrough + s.sheen + s.clearcoat;
  if (!(total > 0)) return Selection{};
  for (float* w : {&s.diffuse, &s.diffuseTransmission, &s.specular, &s.passThrough, &s.sheen, &s.clearcoat})
    *w /= total;
  return s;
}

float Bsdf::layersBroadShare() const {
  const uint32_t broad = broadLobes();
  const Selection& s = select_;
  float share = s.diffuse + s.diffuseTransmission + s.sheen;
  if (broad & kLobeSpecular) share += s.specular;
  if (broad & kLobeClearcoat) share += s.clearcoat;
  // The sum of all is 1 up to rounding: what has one group only must say so exactly.
  const float rest =
      s.passThrough + (broad & kLobeSpecular ? 0.0f : s.specular) + (broad & kLobeClearcoat ? 0.0f : s.clearcoat);
  return share > 0 ? share / (share + rest) : 0.0f;
}

Bsdf Bsdf::restricted(LobeGroup group) const {
  Bsdf b = *this;
  if (group == LobeGroup::All || (diffuseOnly_ && group == LobeGroup::Broad)) return b;
  if (diffuseOnly_) {
    b.initLayers({.lobes = 0}, Transport::Radiance);
    return b;
  }
  const uint32_t broad = broadLobes();
  b.group_ = group;
  b.scatter_ = lobes_ & (group == LobeGroup::Broad ? broad : ~broad);
  b.select_ = restrictedTo(group, select_);
  // Nothing else takes light away from the microfacets then, so that sampling need not evaluate again.
  constexpr uint32_t kOthers = kLobeDiffuse | kLobeDiffuseTransmission;
  b.microfacetOnly_ = !b.scatters(kOthers) && !has(kLobeSheen | kLobeClearcoat) && !passThrough_;
  b.nonDelta_ = b.scatters(kOthers) || (b.scatters(kLobeSpecular | kLobeTransmission) && !smooth_) ||
                (b.scatters(kLobeSheen) && coatedHere_) ||
                (b.scatters(kLobeClearcoat) && coatedHere_ && !clearcoatSmooth_);
  return b;
}

}  // namespace braid
