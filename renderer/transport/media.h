// SPDX-License-Identifier: Apache-2.0
// The solids that a path is inside of. Where solids overlap, the one with the higher refractive index rules (ties: the
// later material), so that every interface is seen alike from both sides; the surface of a ruled solid inside a ruling
// one is no interface and lets rays pass straight through. This is the priority scheme of Schmidt and Budge 2002 with
// priorities taken from the index.
#pragma once

#include <cstdint>

#include "renderer/scene/camera.h"
#include "renderer/scene/scene.h"
#include "renderer/transport/hit.h"

namespace braid {

// Which colour channel a path follows where dispersion makes it follow one (dispersion.h).
struct PathChannel {
  uint8_t index = 3;   // 3: the scene has no dispersion
  bool split = false;  // the path carries this channel alone
};

class MediaStack {
 public:
  bool empty() const { return count_ == 0; }

  void enter(uint32_t material) {
    if (count_ < kCapacity) inside_[count_++] = material;
  }
  // False when the path was not inside of it.
  bool leave(uint32_t material) {
    for (int i = count_; i-- > 0;) {
      if (inside_[i] != material) continue;
      for (int j = i; j + 1 < count_; ++j) inside_[j] = inside_[j + 1];
      --count_;
      return true;
    }
    return false;
  }
  void cross(uint32_t material, bool enters) { enters ? enter(material) : void(leave(material)); }
  // The ruling material, not counting one layer of `except`; -1: none.
  int64_t ruling(const std::vector<Material>& materials, int64_t except = -1) const {
    int64_t best = -1;
    bool skipped = false;
    for (int i = 0; i < count_; ++i) {
      const auto m = static_cast<int64_t>(inside_[i]);
      if (m == except && !skipped) {
        skipped = true;
        continue;
      }
      if (best < 0 || outranks(materials, m, best)) best = m;
    }
    return best;
  }
  static bool outranks(const std::vector<Material>& materials, int64_t a, int64_t b) {
    const float ia = materials[static_cast<size_t>(a)].ior, ib = materials[static_cast<size_t>(b)].ior;
    return ia != ib ? ia > ib : a > b;
  }

 private:
  static constexpr int kCapacity = 8;
  uint32_t inside_[kCapacity] = {};
  int count_ = 0;
};

// The solids around a point that no surface lies between it and, found by following a ray to infinity: what is left
// without having been entered was around the start. For cameras and lights inside of solids.
MediaStack mediaAround(const Scene& scene, const Vec3& point, const Vec3& direction, float time);

// The solids that the camera is inside of at a time.
MediaStack mediaOfCamera(const Scene& scene, const Camera& camera, float time = 0);

// Beer-Lambert transmittance over a distance in metres, by the extinction per metre.
inline Spectrum transmittanceAfter(const Spectrum& extinction, float distance) {
  const Spectrum depth = extinction * distance;
  return {std::exp(-depth.x), std::exp(-depth.y), std::exp(-depth.z)};
}

// The same of a material (KHR_materials_volume: attenuationColor after
// attenuationDistance).
inline Spectrum volumeTransmittance(const Material& m, float distance) {
  if (!isBlack(m.extinction)) return transmittanceAfter(m.extinction, distance);
  if (!(m.attenuationDistance < kInfinity) || m.attenuationColor == Spectrum(1)) return Spectrum(1);
  const float x = distance / m.attenuationDistance;
  if (!std::isfinite(x)) return Spectrum(0);
  return {std::pow(m.attenuationColor.x, x), std::pow(m.attenuationColor.y, x), std::pow(m.attenuationColor.z, x)};
}

// The same through whatever rules there.
inline Spectrum mediaTransmittance(const Scene& scene, const MediaStack& media, float distance) {
  if (media.empty()) return Spectrum(1);
  const int64_t medium = media.ruling(scene.materials());
  return medium < 0 ? Spectrum(1) : volumeTransmittance(scene.materials()[static_cast<size_t>(medium)], distance);
}

// Refractive index of whatever rules there.
inline float mediumIndex(const Scene& scene, const MediaStack& media) {
  const int64_t medium = media.empty() ? -1 : media.ruling(scene.materials());
  return medium < 0 ? 1.0f : scene.materials()[static_cast<size_t>(medium)].ior;
}

// Refractive index on the outside of a hit surface, for a path inside of `media`.
inline float indexOutside(const Scene& scene, const MediaStack& media, const Hit& hit, PathChannel channel = {}) {
  if (media.empty()) return 1;
  const int64_t medium = media.ruling(scene.materials(), hit.front ? -1 : static_cast<int64_t>(hit.mesh->material));
  return medium < 0 ? 1.0f : scene.materials()[static_cast<size_t>(medium)].indexOf(channel.index);
}

// Whether the hit surface of a solid lies inside of another one that rules there: it scatters nothing, and rays go
// straight on.
inline bool isNullInterface(const Scene& scene, const MediaStack& media, const Hit& hit) {
  const auto material = static_cast<int64_t>(hit.mesh->material);
  const int64_t other = media.ruling(scene.materials(), hit.front ? -1 : material);
  return other >= 0 && MediaStack::outranks(scene.materials(), other, material);
}

// Takes the path through the hit surface and returns the ratio of the refractive indices before and after.
inline float crossInterface(const Scene& scene, MediaStack& media, const Hit& hit) {
  const auto index = [&](int64_t m) {
    return m < 0 ? 1.0f : std::max(scene.materials()[static_cast<size_t>(m)].ior, 1e-3f);
  };
  const float before = index(media.ruling(scene.materials()));
  media.cross(hit.mesh->material, hit.front);
  return before / index(media.ruling(scene.materials()));
}

}  // namespace braid
