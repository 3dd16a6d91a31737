// SPDX-License-Identifier: Apache-2.0
// What integrators with light subpaths prepare once per render.
#pragma once

#include "renderer/session/preparation_ref.h"
#include "renderer/transport/light_emission.h"

namespace braid {

struct LightPreparation : Preparation {
  explicit LightPreparation(const TransportContext& context);
  LightEmission emission;
  int splatFractionBits = 32;  // PassTarget::setSplatFractionBits()

  using Ref = PreparationRef<LightPreparation>;
};

// Whether photons find light that camera paths find by rare chance only: caustics.
Applies photonsApply(const SceneTraits& traits, const LightReach& reach);

// Whether light subpaths are worth connecting to camera paths beside a photon map, instead of camera paths alone: where
// caustics are much of the light in view, or none that a camera path can find.
Applies connectionsApply(const SceneTraits& traits, const LightReach& reach);

}  // namespace braid
