// SPDX-License-Identifier: Apache-2.0
// Next-event estimation: picks a light and a point or direction on it. Lights are numbered: emissive triangles first,
// then punctual lights with a position, directional lights, the environment.
#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/scene/scene.h"
#include "renderer/transport/lights/light_tree.h"

namespace braid {

struct LightSample {
  Vec3 wi;               // unit, from the shading point to the light
  float distance = 0;    // metres; infinity for directional lights and the environment
  Spectrum radiance{0};  // arriving along wi, before visibility. Delta lights: already divided by distance²
  float pdfW =
      0;  // density per solid angle including the choice of the light; for delta lights the probability of the choice
  bool delta = false;
  uint32_t light = 0;  // number of the light, see LightSampler::size()
};

// A point that light may reach, at the time of its path.
struct Receiver {
  Vec3 position;
  Vec3 normal;            // of shading; not zero unless twoSided
  bool twoSided = false;  // the surface transmits
  float time = 0;
};

// How finite lights are chosen.
enum class LightStrategy { Automatic, Power, Hierarchy };

// Whether a light hierarchy is worth its cost: not for up to two emissive triangles, which are the halves of one lamp
// as a rule; yes as soon as distances and cones of several lights differ from point to point.
bool hierarchyPays(size_t emissiveTriangles, size_t positionalLights);

// Of light samples those that choose a finite light, a directional one and the environment. They add up to 1, or are
// all 0 without lights.
using LightKinds = std::array<float, 3>;

class LightSampler {
 public:
  // Automatic: see hierarchyPays().
  LightSampler(const Scene& scene, LightStrategy strategy);

  // By default half by the irradiance that each kind would give unoccluded and half evenly among those that are there;
  // a kind that is not has 0. Set before anything is rendered (light_kinds.h).
  const LightKinds& kinds() const { return kinds_; }
  void setKinds(const LightKinds& kinds) { kinds_ = kinds; }

  // Samples a light for a point. False: no light can contribute.
  bool sample(const Receiver& at, float uSelect, Vec2 u, LightSample& out) const;

  // The same in two steps, where there is a hierarchy: pick() walks it for many points at once.
  static LightQuery queryOf(const Receiver& at, float uSelect) {
    return {at.position, at.normal, at.twoSided, uSelect};
  }
  void pick(std::span<LightQuery> queries) const;
  bool sample(const Receiver& at, const LightQuery& picked, Vec2 u, LightSample& out) const;

  // Density with which sample() would pick the direction to a point hit on emitter `index` (distance in metres, cosine
  // at the light > 0).
  float pdfEmitter(const Receiver& at, size_t index, float distance, float cosLight) const;
  float pdfEnvironment(const Receiver& at, const Vec3& direction) const;

  // Density with which sample() at a receiver picks a point of a light: per m² for emissive triangles, per solid angle
  // about `toLight` for the environment, a probability for the others.
  float pdfDirect(uint32_t light, const Receiver& at, const Vec3& toLight) const;

  // Lights in all, and where each kind begins in the numbering.
  uint32_t size() const { return environmentLight() + (scene_.environment() ? 1u : 0u); }
  uint32_t firstPositional() const { return static_cast<uint32_t>(scene_.emitters().size()); }
  uint32_t firstDirectional() const { return static_cast<uint32_t>(finite_); }
  uint32_t environmentLight() const { return static_cast<uint32_t>(finite_ + directional_.size()); }
  const PunctualLight& positional(uint32_t light) const {
    return scene_.lights()[positional_[light - firstPositional()]];
  }
  const PunctualLight& directional(uint32_t light) const {
    return scene_.lights()[directional_[light - firstDirectional()]];
  }

  size_t finiteLights() const { return finite_; }
  bool usesHierarchy() const { return hierarchy_; }
  size_t bytes() const { return tree_.bytes() + cumulative_.size() * sizeof(float); }

 private:
  bool sampleFinite(const Receiver& at, size_t light, float probability, Vec2 u, LightSample& out) const;
  bool sampleInfinite(const Receiver& at, float uSelect, Vec2 u, LightSample& out) const;
  bool sampleEmitter(const EmissiveTriangle& e, const Receiver& at, Vec2 u, LightSample& out) const;
  bool samplePunctual(const PunctualLight& light, const Receiver& at, LightSample& out) const;
  float finiteProbability(const Receiver& at, size_t light) const;
  float areaOf(size_t emitter, float time) const;

  const Scene& scene_;
  size_t finite_ = 0;
  bool hierarchy_ = false;
  LightTree tree_;
  std::vector<float> cumulative_;     // by power, when there is no hierarchy
  std::vector<uint32_t> positional_;  // punctual lights with a position
  std::vector<uint32_t> directional_;
  std::vector<float> directionalCumulative_;
  LightKinds kinds_{};
};

// What the range of a light leaves of it at a distance, in [0, 1]: the window of KHR_lights_punctual, which ends
// without an edge. The distance is that of the straight way from the light to the first surface that scatters.
inline float rangeWindow(const PunctualLight& light, float distance) {
  if (!(light.range < kInfinity)) return 1;
  return std::max(1 - sqr(sqr(distance / light.range)), 0.0f);
}

// Spot attenuation of KHR_lights_punctual for the cosine between the axis and the direction from the light, in [0, 1].
float spotFalloff(const PunctualLight& light, float cosAngle);

}  // namespace braid
