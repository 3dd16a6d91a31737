// SPDX-License-Identifier: Apache-2.0
// What photon mapping works out once per render, from a pilot: which lights' photons come to rest where the camera
// looks, and how many photons a light subpath leaves.
#pragma once

#include <optional>

#include "integrators/sppm/sppm_photons.h"
#include "renderer/session/preparation_ref.h"

namespace braid {

class PhotonPreparation : public Preparation {
 public:
  PhotonPreparation(const TransportContext& context, const Plan& plan);

  const LightEmission& emission() const { return *emission_; }
  // Probability with which a photon is kept, so that kStoredPerPath bounds what a pass stores.
  float keep() const { return keep_; }
  // Whether lights are chosen by the pilot's findings; not where that would not pay.
  bool aimed() const { return aimed_; }

  using Ref = PreparationRef<PhotonPreparation>;

 private:
  std::optional<LightEmission> emission_;
  float keep_ = 1;
  bool aimed_ = false;
};

}  // namespace braid
