// SPDX-License-Identifier: Apache-2.0
// Camera paths of a measurement before the render: few, and evenly spread over the frame.
#pragma once

#include <cmath>

#include "renderer/transport/subpath.h"

namespace braid {

// In [0, 1)², evenly spread from the first points on: additive recurrence by the powers of the plastic number (Roberts
// 2018, "The unreasonable effectiveness of quasirandom sequences").
inline Vec2 framePoint(int i) {
  const double x = 0.5 + 0.7548776662466927 * i, y = 0.5 + 0.5698402909980532 * i;
  return {static_cast<float>(x - std::floor(x)), static_cast<float>(y - std::floor(y))};
}

// Walks of so many segments that are never ended before, and whose weights no one asks for.
inline WalkSettings glanceSettings(int segments) {
  WalkSettings settings;
  settings.maxSegments = segments;
  settings.roulette = {Roulette::kNever, 1};
  settings.mis = false;
  return settings;
}

// Begins walk i of a batch at framePoint(i) of a frame of that many pixels, at a time of its own.
inline void startGlance(const Scene& scene, const Camera& camera, Vec2 frame, const MediaStack& media, int i,
                        SubpathBatch& batch) {
  const uint64_t key = batch.sampler().itemKey(static_cast<uint64_t>(i));
  const float time = scene.timeAt(batch.sampler().block(key, 0).u[slot::kTime]);
  Camera::CameraRay ray = CameraAt(camera, time)->ray(framePoint(i) * frame);
  ray.time = time;
  batch.startCamera(key, ray, media, 1, 1, camera.orthographic());
}

}  // namespace braid
