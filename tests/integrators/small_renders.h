// SPDX-License-Identifier: Apache-2.0
// Small renders by any registered integrator.
#pragma once

#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "integrators/registry.h"
#include "renderer/session/session.h"

namespace braid::test::small_renders {

using Integrators = std::vector<std::unique_ptr<Integrator>>;

inline CameraData cameraOf(const Scene& scene) {
  return scene.data().cameras.empty() ? CameraData() : scene.data().cameras[0];
}

inline Settings smallFrame(int width, int height, uint64_t spp, const std::string& integrator) {
  Settings s;
  s.width = width;
  s.height = height;
  s.spp = spp;
  s.integrators = {integrator};
  return s;
}

inline RenderResult render(const Scene& scene, const Settings& settings, const Integrators& all) {
  return Session(scene, makePlan(scene, cameraOf(scene), settings, pointersTo(all))).run();
}

inline bool sameBits(const Rgb<float>& a, const Rgb<float>& b) {
  for (size_t c = 0; c < 3; ++c)
    if (a[c].size() != b[c].size() || std::memcmp(a[c].data.data(), b[c].data.data(), a[c].size() * 4) != 0)
      return false;
  return true;
}

inline bool sameBits(const RenderResult& a, const RenderResult& b) {
  const Estimate &x = a.estimates->estimates[0], &y = b.estimates->estimates[0];
  const Features &f = *a.estimates->features, &g = *b.estimates->features;
  return sameBits(x.mean, y.mean) && sameBits(x.half[0], y.half[0]) && sameBits(x.half[1], y.half[1]) &&
         sameBits(x.variance, y.variance) && sameBits(f.albedo.mean, g.albedo.mean) &&
         sameBits(f.normal.variance, g.normal.variance);
}

// Finite everywhere and nowhere negative, unless noise may be.
inline bool sane(const Rgb<float>& image, bool mayBeNegative = false) {
  for (size_t c = 0; c < 3; ++c)
    for (const float v : image[c].data)
      if (!std::isfinite(v) || (v < 0 && !mayBeNegative)) return false;
  return !image.empty();
}

}  // namespace braid::test::small_renders
