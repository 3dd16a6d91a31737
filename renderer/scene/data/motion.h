// SPDX-License-Identifier: Apache-2.0
// Moments while the shutter is open, and what lies between two steps of a motion. Paths have times from 0 to 1 in which
// the steps are evenly spaced, as Embree has them; shutterTime() spreads them over the seconds.
#pragma once

#include <algorithm>
#include <vector>

#include "renderer/scene/data/scene_data.h"

namespace braid {

// The two steps around a time.
struct Moment {
  size_t first;    // the second is the next one
  float fraction;  // of the way from the first to the second
};

// Of a motion of `segments` + 1 steps, rounded as Embree does.
inline Moment momentAt(float time, size_t segments) {
  const auto count = static_cast<float>(segments);
  const float at = time * count;
  const float first = std::clamp(std::floor(at), 0.0f, count - 1);
  return {static_cast<size_t>(first), at - first};
}

template <class T>
T between(const T& a, const T& b, float fraction) {
  return a * (1 - fraction) + b * fraction;
}

// The time at which a path is that is traced when this share of the shutter's seconds, from 0 to 1, has gone by. Never
// within a jump.
inline float shutterTime(const SceneMotion& motion, float share) {
  if (!motion.any()) return 0;
  const std::vector<float>& times = motion.times;
  const auto after = std::upper_bound(times.begin() + 1, times.end() - 1, share);
  const auto second = static_cast<size_t>(after - times.begin());
  const float length = times[second] - times[second - 1];
  const float fraction = length > 0 ? std::clamp((share - times[second - 1]) / length, 0.0f, 1.0f) : 1.0f;
  return (static_cast<float>(second - 1) + fraction) / static_cast<float>(times.size() - 1);
}

// A light at a time; of a direction that turns, the steps are near each other.
inline LightPlace placeAt(const PunctualLight& light, float time) {
  if (light.steps.empty()) return light;
  const Moment m = momentAt(time, light.steps.size());
  const LightPlace &a = m.first == 0 ? light : light.steps[m.first - 1], &b = light.steps[m.first];
  const Vec3 direction = between(a.direction, b.direction, m.fraction);
  const float length = glm::length(direction);
  return {between(a.position, b.position, m.fraction), length > 1e-6f ? direction / length : a.direction};
}

}  // namespace braid
