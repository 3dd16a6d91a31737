// SPDX-License-Identifier: Apache-2.0
// The state of a path between two vertices.
#pragma once

#include "renderer/core/sampler.h"
#include "renderer/transport/bsdf/bsdf.h"
#include "renderer/transport/hit.h"
#include "renderer/transport/context.h"
#include "renderer/transport/media.h"
#include "renderer/transport/random_walk.h"

namespace braid {

struct PathState {
  Vec3 origin, direction;
  Spectrum throughput{1};
  MediaStack media;
  PathChannel channel;
  int segments = 0;       // traced so far, null interfaces not counted
  int nullCrossings = 0;  // bounds a path through degenerate nested surfaces
  int panes = 0;          // passed straight; they are no vertices
  uint32_t salt = 0;      // of stochastic coverage, one per ray
  uint64_t key = 0;       // of the path's random numbers
  // Its points: those of the camera's path, or of one of the branches that it is split into, which share a key.
  const PassSampler* points = nullptr;
  uint64_t pointsKey = 0;
  int sample = 0;      // that it adds to
  int directions = 1;  // that its vertex goes on in
  float time = 0;

  // The last vertex that scattered, for the weight of light found by the direction sampled there.
  Vec3 lastPosition{0}, lastNormal{0};
  bool lastTwoSided = false;
  Receiver lastReceiver() const { return {lastPosition, lastNormal, lastTwoSided, time}; }
  float lastPdfW = 0;
  float lastLightSamples = 1;
  bool lightCouldNotBeSampled = true;  // camera, delta scattering, or a null interface or a medium's event since

  float rouletteScale = 1;    // undoes in Russian roulette the radiance compression of refraction, guide and splits
  int bounces = 0;            // scattered at the first non-specular vertex and since; up to 1 of them, light is direct
  bool isBranch = false;      // of a path that was split, which is done once
  bool featuresDone = false;  // the first non-specular vertex is behind
  float leastLobe = 1;        // the least probability of the delta lobes taken before
  float featureDistance = 0;  // metres travelled up to it

  WalkState walk;

  // Of the random numbers at the surface ahead.
  unsigned block() const { return static_cast<unsigned>(segments + panes); }
  // Nothing but null interfaces has been met.
  bool fromCamera() const { return segments == 1 && panes == 0; }
};

}  // namespace braid
