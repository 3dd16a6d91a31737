// SPDX-License-Identifier: Apache-2.0
// Dispersion (KHR_materials_dispersion). A path carries all three colour channels up to the first surface whose
// refraction depends on colour, and one from there on, with the channel's index. Camera paths that nothing is joined to
// go on once for every channel. All others follow one that is drawn with probability 1/3, with three times the weight:
// of paths that are joined each has a channel of its own; what they carry together is 0 where these differ, and right
// on average.
#pragma once

#include "renderer/core/sampler.h"
#include "renderer/transport/context.h"
#include "renderer/transport/media.h"

namespace braid {

// `key`: of the path's random numbers. Of the one path that its number means in scenes without dispersion: no channel.
inline PathChannel channelOf(const Scene& scene, const PassSampler& sampler, uint64_t key) {
  if (!scene.traits().has(kTraitDispersion)) return {};
  const float u = sampler.block(key, 0).u[slot::kChannel];
  return {static_cast<uint8_t>(std::min(static_cast<int>(3 * u), 2)), false};
}

// Whether the hit surface, met from within `media`, refracts colours differently.
inline bool disperses(const TransportContext& context, const MediaStack& media, const Hit& hit) {
  if (context.summaryOf(hit).disperses) return true;
  if (media.empty()) return false;
  const std::vector<Material>& materials = context.scene.materials();
  const int64_t around = media.ruling(materials, hit.front ? -1 : static_cast<int64_t>(hit.mesh->material));
  return around >= 0 && materials[static_cast<size_t>(around)].disperses();
}

// Whether a path that carries all channels up to this surface carries one from here on.
inline bool coloursPart(const TransportContext& context, const MediaStack& media, const Hit& hit, PathChannel channel) {
  return channel.index < 3 && !channel.split && disperses(context, media, hit);
}

// From here on one channel alone, with so many times the weight.
inline void followOne(uint8_t index, float weight, PathChannel& channel, Spectrum& throughput) {
  channel = {index, true};
  Spectrum alone(0);
  alone[index] = weight * throughput[index];
  throughput = alone;
}

// At a surface that the path has come to, before its BSDF: from there on it follows the channel drawn.
inline void drawColour(const TransportContext& context, const MediaStack& media, const Hit& hit, PathChannel& channel,
                       Spectrum& throughput) {
  if (coloursPart(context, media, hit, channel)) followOne(channel.index, 3, channel, throughput);
}

// surfaceAt() with the indices of the path's channel.
inline SurfaceParameters surfaceAt(const Scene& scene, const Hit& hit, uint32_t lobes, const MediaStack& media,
                                   PathChannel channel) {
  SurfaceParameters s = surfaceAt(scene, hit, lobes, indexOutside(scene, media, hit, channel));
  s.etaInside = hit.material->indexOf(channel.index);
  return s;
}

}  // namespace braid
