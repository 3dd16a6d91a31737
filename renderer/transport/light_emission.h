// SPDX-License-Identifier: Apache-2.0
// Where light subpaths start: a light chosen by power, a point on it and a direction. Directional lights and the
// environment start on a disc that covers the scene's bounding sphere (Veach 1997, section 8.3; Pharr et al. 2023,
// section 12.6).
#pragma once

#include <vector>

#include "renderer/transport/lights/light_sampler.h"
#include "renderer/transport/media.h"

namespace braid {

// The first vertex of a light subpath.
struct LightStart {
  Vec3 position{0};         // on the light; for lights at infinity on a disc before the scene
  Vec3 direction{0, 0, 1};  // unit, away from the light
  Vec3 normal{0, 0, 1};     // of an emissive triangle, on the side of `direction`; else `direction`
  float positionError = 0;  // metres, as Hit::positionError
  Spectrum throughput{0};   // radiance · cosLight / pdfEmit (or intensity / pdfEmit), W per channel
  float pdfEmit = 0;        // see LightEmission::pdfEmit()
  float cosLight = 1;       // cosine at an emissive triangle, 1 for all others
  uint32_t light = 0;       // LightSampler's number
  float time = 0;           // of the path
  bool finite = true;       // false: directional lights and the environment
  bool delta = false;       // no ray can hit the light
};

class LightEmission {
 public:
  // Lights are chosen by power times `usefulness` (one factor per light, LightSampler's numbering; empty: all 1).
  LightEmission(const Scene& scene, const LightSampler& lights, const std::vector<float>& usefulness = {});

  // uSelect has 48 bits where a product of two variates gives them, so that a million lights keep their exact shares.
  // False: nothing emits.
  bool sample(double uSelect, Vec2 uPosition, Vec2 uDirection, float time, LightStart& out) const;

  // Density with which sample() starts a path at a given light, including its choice: per m² (of the triangle) and
  // steradian for emissive triangles, per steradian for point and spot lights, per m² (of the disc) for directional
  // lights, per m² and steradian for the environment. `direction` leads away from the light; cosLight > 0 is the cosine
  // at an emissive triangle.
  float pdfEmit(uint32_t light, const Vec3& direction, float cosLight, float time) const;

  bool empty() const { return cumulative_.empty(); }
  double probability(uint32_t light) const {
    return cumulative_.empty() ? 0 : cumulative_[size_t(light) + 1] - cumulative_[light];
  }
  // Total emitted power, W, channel average; lights at infinity count what crosses the scene's disc.
  double power() const { return power_; }
  // The solids around the light of a start; empty for lights at infinity and in scenes without volumes.
  MediaStack mediaAt(const LightStart& start) const;

 private:
  bool startOnTriangle(uint32_t light, Vec2 uPosition, Vec2 uDirection, LightStart& out) const;
  bool startAtPoint(uint32_t light, Vec2 uDirection, LightStart& out) const;
  bool startAtInfinity(uint32_t light, Vec2 uPosition, Vec2 uDirection, LightStart& out) const;
  void findMedia();

  const Scene& scene_;
  const LightSampler& lights_;
  std::vector<double> cumulative_;  // size() + 1 values, or none when nothing emits
  double power_ = 0;
  std::vector<std::pair<uint32_t, MediaStack>> media_;  // of lights inside of solids, by number
};

}  // namespace braid
