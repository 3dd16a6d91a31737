// SPDX-License-Identifier: Apache-2.0
// The density estimate of photon mapping: radii, and the light that the photons about a point send to the eye.
#pragma once

#include "integrators/sppm/photon_grid.h"
#include "renderer/session/plan.h"
#include "renderer/transport/light_emission.h"
#include "renderer/transport/subpath.h"

namespace braid {

// The factor of a pass' radii, of the first ones': i^(-(1 - alpha)/2) with alpha = 2/3, i = pass / 4 + 1, so that the
// four buckets of the film see the same radii and both halves have the same bias (integrators/README.md, Photon
// mapping).
float radiusShrinkage(uint64_t pass);

// Gather radii of a pass: Settings::photonRadius pixels as seen over the path from the camera, between 1e-7 and 0.05 of
// the scene's radius, times radiusShrinkage().
RadiusScale gatherRadii(const Plan& plan, const SceneTraits& traits, uint64_t pass, float time = 0);

// The share of the disc's area that lies in its inner disc: smaller ones estimate more of the bias at edges of light,
// but are noisier (integrators/README.md, Bias of photon maps).
inline constexpr float kInnerArea = 0.25f;

// Sums of f · |cos| · power / |geometric cos| over photons, by their distance.
struct PhotonSum {
  Spectrum inner{0}, outer{0};  // inside of the inner disc, and beyond
  uint32_t photons = 0;         // inside of the radius, also those that do not count
};

// What photons about a vertex send toward the eye, W·sr⁻¹·m⁻², before the eye path's throughput.
struct GatheredLight {
  Spectrum radiance{0};
  Spectrum bias{0};  // of it, estimated
};
GatheredLight gatheredLight(const PhotonSum& sum, double lightPaths, float radius);

// Gathers at an eye vertex with its BSDF as it is. `maxSegments`: longest light subpath that counts.
PhotonSum gatherPhotons(const PhotonGrid& grid, const SubpathVertex& vertex, float radius, int maxSegments);

// Light that met delta scattering alone on its way to a narrow lobe is found in two ways: the eye path hits the lamp,
// or photons of that light lie about the vertex. Small lamps want the second, sharp reflections the first; the power
// heuristic weighs them (as merging does in Georgiev et al. 2012, with these two ways alone).
struct CausticMerging {
  const CausticGrid& grid;
  const LightEmission& emission;
  double lightPaths;  // of the pass
  float keep = 1;     // probability with which a photon is kept

  // Photons kept within a radius, if each light subpath left one per m².
  double density(float radius) const {
    return lightPaths * static_cast<double>(keep) * static_cast<double>(kPi) * sqr(static_cast<double>(radius));
  }
};

// Gathers caustic photons at an eye vertex by the lobes of `narrow`, each weighed against hitting its light with the
// probability `choice` of going on by those lobes.
PhotonSum gatherCaustics(const CausticMerging& merging, const SubpathVertex& vertex, const Bsdf& narrow, float choice,
                         float radius, int maxSegments);

}  // namespace braid
