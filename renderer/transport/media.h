// SPDX-License-Identifier: Apache-2.0
// The solids that a path is inside of. Where solids overlap, the one with the higher refractive index rules (ties: the
// later material), so that every interface is seen alike from both sides; the surface of a ruled solid inside a ruling
// one is no interface and lets rays pass straight through. This is the priority scheme of Schmidt and Budge 2002 with
// priorities taken from the index.
#pragma once

#include <cstdint>

#include "renderer/scene/camera.h"
#include "renderer/scene/scene.h"

namespace braid {

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
MediaStack mediaAround(const Scene& scene, const Vec3& point, const Vec3& direction);

// The solids that the camera is inside of.
MediaStack mediaOfCamera(const Scene& scene, const Camera& camera);

// Beer-Lambert transmittance over a distance in metres (KHR_materials_volume: attenuationColor after
// attenuationDistance).
inline Spectrum volumeTransmittance(const Material& m, float distance) {
  if (!(m.attenuationDistance < kInfinity) || m.attenuationColor == Spectrum(1)) return Spectrum(1);
  const float x = distance / m.attenuationDistance;
  if (!std::isfinite(x)) return Spectrum(0);
  return {std::pow(m.attenuationColor.x, x), std::pow(m.attenuationColor.y, x), std::pow(m.attenuationColor.z, x)};
}

}  // namespace braid
