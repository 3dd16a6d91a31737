// SPDX-License-Identifier: Apache-2.0
// What every integrator needs besides the scene: the light sampler and the lobes of each material, built once per
// render.
#pragma once

#include <vector>

#include "renderer/scene/scene.h"
#include "renderer/transport/hit.h"
#include "renderer/transport/lights/light_sampler.h"

namespace braid {

// Records the rays of a render, so that a benchmark can trace exactly the same ones again without shading.
struct RecordedRay : RayQuery {
  bool shadow = false;
};

// What shading asks of every material, in a few bytes: materials themselves are large.
struct MaterialSummary {
  uint32_t lobes = 0;  // LobeFlags
  bool emissive = false, unlit = false, volume = false;
  bool pane = false;  // Material::mayBePane()
  bool ground = false;
  bool disperses = false;
  bool transmits() const { return (lobes & kTransmittingLobes) != 0; }
  bool special() const { return emissive || unlit || volume || ground; }
};

struct TransportContext {
  const Scene& scene;
  LightSampler lights;
  std::vector<MaterialSummary> materials;

  explicit TransportContext(const Scene& s, LightStrategy strategy = LightStrategy::Automatic)
      : scene(s), lights(s, strategy) {
    for (const Material& m : s.materials())
      materials.push_back(
          {materialLobes(m), m.emissive(), m.unlit, m.hasVolume(), m.mayBePane(), m.isGround, m.disperses()});
  }
  const MaterialSummary& summaryOf(const Hit& hit) const { return materials[hit.mesh->material]; }
};

}  // namespace braid
