// SPDX-License-Identifier: Apache-2.0
// What every integrator needs besides the scene: the light sampler and the lobes of each material, built once per render.
#pragma once

#include <vector>

#include "renderer/scene/scene.h"
#include "renderer/transport/hit.h"
#include "renderer/transport/light_sampler.h"

namespace braid {

// Records the rays of a render, so that a benchmark can trace exactly the same ones again without shading.
struct RecordedRay : RayQuery {
  bool shadow = false;
};

struct TransportContext {
  const Scene& scene;
  LightSampler lights;
  std::vector<uint32_t> lobes;  // LobeFlags per material

  explicit TransportContext(const Scene& s, LightStrategy strategy = LightStrategy::Automatic) : scene(s), lights(s, strategy) {
    for (const Material& m : s.materials()) lobes.push_back(materialLobes(m));
  }
  uint32_t lobesOf(const Hit& hit) const { return lobes[hit.mesh->material]; }
};

}  // namespace braid
