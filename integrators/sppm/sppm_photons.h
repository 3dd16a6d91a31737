// SPDX-License-Identifier: Apache-2.0
// The photon half of a photon mapping pass: light subpaths, and what of them is kept.
#pragma once

#include <algorithm>
#include <vector>

#include "integrators/sppm/photon_grid.h"
#include "renderer/session/integrator.h"
#include "renderer/transport/light_emission.h"
#include "renderer/transport/subpath.h"

namespace braid {

// The light subpaths of one pass.
struct PhotonEmission {
  const LightEmission& emission;
  const PassSampler& sampler;
  uint64_t paths;  // in all: the choice of the light is stratified over them
  float time = 0;  // of all of them
};

// Light subpaths of a pass: as asked for, or one per pixel of the window, of which a small window gets a few more.
uint64_t photonPaths(const Plan& plan);
// Segments of a light subpath at which its photons begin to count: direct light is found otherwise, unless asked for.
inline int firstPhotonSegment(const Settings& settings) { return settings.photonDirect ? 1 : 2; }

// Whether caustics in the reflections of narrow lobes are found by photons, too; see CausticMerging.
inline bool mergesCaustics(const Scene& scene, int maxDepth) {
  return maxDepth > 2 && scene.traits().hasLobe(kLobeSpecular | kLobeTransmission | kLobeClearcoat);
}

// Follows the light subpaths [begin, end); onVertex(item, vertex) is called wherever one arrives, for gathering or
// not. Returns the number of segments traced.
template <class OnVertex>
uint64_t followLightPaths(const TransportContext& context, const PhotonEmission& light, int maxDepth, uint64_t begin,
                          uint64_t end, const OnVertex& onVertex) {
  WalkSettings settings;
  settings.transport = Transport::Power;
  settings.maxSegments = maxDepth - 1;  // one more leads to the camera
  // Roulette from the first bounce keeps the photons' powers alike, which is what a density estimate wants.
  settings.roulette = {1, 1};
  settings.mis = false;
  settings.deltaChains = mergesCaustics(context.scene, maxDepth);
  SubpathBatch batch(context, light.sampler, settings);
  for (uint64_t first = begin; first < end; first += kBatch) {
    const uint64_t last = std::min(end, first + kBatch);
    batch.clear();
    for (uint64_t item = first; item < last; ++item) {
      const uint64_t key = light.sampler.itemKey(item);
      const SampleBlock u = light.sampler.block(key, 1);
      const double select =
          (static_cast<double>(item) + static_cast<double>(u.u[slot::kLightSelect])) / static_cast<double>(light.paths);
      batch.startLight(key, light.emission, select, u, light.time);
    }
    batch.run([&](int i, const SubpathState& state,
                  const SubpathVertex& vertex) { return onVertex(first + static_cast<uint64_t>(i), state, vertex); },
              [](int, const SubpathState&) {});
  }
  return batch.rayCount;
}

// Whether a light subpath's vertex is of use to gather points: light arrives on the visible side of a broad lobe.
inline bool depositsPhoton(const SubpathVertex& vertex, int firstSegment) {
  return (vertex.segments >= firstSegment || vertex.walked) && !vertex.woBelow && vertex.bsdf.broadShare() > 0;
}

// Whether light that met delta scattering alone arrives where a narrow lobe scatters it.
bool depositsCaustic(const SubpathVertex& vertex);

// At most this many photons of a light subpath are kept on average: what a pass holds in memory is bounded.
inline constexpr double kStoredPerPath = 4;

struct TracedPhotons {
  std::vector<Photon> photons;
  std::vector<CausticPhoton> caustics;  // where mergesCaustics(); those at broad lobes are among `photons` as well
  uint64_t segments = 0;
};

// Traces all light subpaths. `keep`: probability with which a photon is kept, its power is divided by it. Returns false
// when cancelled. The photons' order does not depend on threads.
bool tracePhotons(const TransportContext& context, const PhotonEmission& light, const Settings& settings, float keep,
                  const std::atomic<bool>* cancel, TracedPhotons& out);

}  // namespace braid
