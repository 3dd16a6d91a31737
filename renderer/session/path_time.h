// SPDX-License-Identifier: Apache-2.0
// The one time of a path, at which it finds the scene, its lights and the camera.
#pragma once

#include "renderer/core/hash.h"
#include "renderer/core/sampler.h"
#include "renderer/session/plan.h"

namespace braid {

// Of the path through pixel (x, y) of the full frame; `camera` is block 0 of its random numbers. Every pixel turns the
// variate by an angle of its own, so that those which share random numbers do not share a moment as well: few samples
// would show few sharp pictures over each other.
inline float pixelTime(const Scene& scene, const Plan& plan, const SampleBlock& camera, int x, int y) {
  if (!scene.moves()) return 0;
  const float turned = camera.u[slot::kTime] + static_cast<float>(mix64(pixelItem(plan, x, y)) >> 40) * 0x1p-24f;
  return scene.timeAt(turned < 1 ? turned : turned - 1);
}

// Of all paths of a pass, where paths of different pixels meet.
inline float passTime(const Scene& scene, const PassSampler& sampler) {
  constexpr uint64_t kNoPixel = ~uint64_t(0);
  return scene.moves() ? scene.timeAt(sampler.block(sampler.itemKey(kNoPixel), 0).u[slot::kTime]) : 0;
}

}  // namespace braid
