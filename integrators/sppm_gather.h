// SPDX-License-Identifier: Apache-2.0
// The density estimate of photon mapping: radii, and the light that the photons about a point send to the eye.
#pragma once

#include "integrators/photon_grid.h"
#include "renderer/session/plan.h"
#include "renderer/transport/subpath.h"

namespace braid {

// The factor of a pass' radii, of the first ones': r_i = r_1 i^(-(1 - alpha)/2) with alpha = 2/3 (Georgiev et al. 2012;
// Knaus and Zwicker 2011), i = pass / 4 + 1: the four buckets of the film see the same radii, so that both halves have
// the same bias. Variance and squared bias of the mean then both fall as passes^(-2/3).
float radiusShrinkage(uint64_t pass);

// Gather radii of a pass: Settings::photonRadius pixels as seen over the path from the camera, between 1e-7 and 0.05 of
// the scene's radius, times radiusShrinkage().
RadiusScale gatherRadii(const Plan& plan, const SceneTraits& traits, uint64_t pass);

// Sums of f · |cos| · power / |geometric cos| over photons, by their distance.
struct PhotonSum {
  Spectrum inner{0}, outer{0};  // closer than radius / √2, and beyond: equal areas
  uint32_t photons = 0;         // inside of the radius, also those that do not count
};

// Gathers at an eye vertex with its BSDF as it is. `maxSegments`: longest light subpath that counts.
PhotonSum gatherPhotons(const PhotonGrid& grid, const SubpathVertex& vertex, float radius, int maxSegments);

}  // namespace braid
