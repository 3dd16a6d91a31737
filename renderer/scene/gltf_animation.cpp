// SPDX-License-Identifier: Apache-2.0
// Animation channels evaluated at one moment: STEP, LINEAR and CUBICSPLINE, clamped outside their keys.
#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>

#include "renderer/scene/gltf_accessor.h"
#include "renderer/scene/gltf_pose.h"

namespace braid::gltf {

namespace {

// The keys around a moment: index of the first, where between them (0 to 1) and how long apart.
struct KeySpan {
  size_t first = 0, second = 0;
  float fraction = 0, duration = 0;
};

KeySpan findKeys(const std::vector<float>& times, float time) {
  if (!(time > times.front())) return {};
  if (time >= times.back()) return {times.size() - 1, times.size() - 1, 0, 0};
  const auto after = std::upper_bound(times.begin(), times.end(), time);
  const auto second = static_cast<size_t>(after - times.begin());
  const float duration = times[second] - times[second - 1];
  return {second - 1, second, (time - times[second - 1]) / duration, duration};
}

class Animator {
 public:
  Animator(Document& document, float time) : document_(document), time_(time) {}

  void apply(const AnimationChannel& channel) {
    const std::vector<float>& times = floats(channel.input);
    if (times.empty()) return;
    if (!isIncreasing(channel, times)) return;
    Node& node = document_.nodes[channel.node];
    if (node.matrix && channel.path != AnimatedPath::Weights) {
      document_.report.warn(channel.pointer, "an animated node has a matrix; it stays at rest");
      return;
    }
    const size_t width = widthOf(channel, node);
    if (width == 0) return;
    const std::vector<float> value = evaluate(channel, findKeys(times, time_), width);
    if (std::all_of(value.begin(), value.end(), [](float v) { return std::isfinite(v); })) {
      assign(node, channel.path, value);
    } else {
      document_.report.warn(channel.pointer,
                            "an animation yields values that are not finite; its target stays at rest");
    }
  }

 private:
  bool isIncreasing(const AnimationChannel& channel, const std::vector<float>& times) {
    for (size_t i = 0; i < times.size(); ++i) {
      if (std::isfinite(times[i]) && (i == 0 || times[i] > times[i - 1])) continue;
      document_.report.warn(channel.pointer, "the key times of an animation do not increase; it is ignored");
      return false;
    }
    return true;
  }

  size_t widthOf(const AnimationChannel& channel, const Node& node) const {
    switch (channel.path) {
      case AnimatedPath::Rotation:
        return 4;
      case AnimatedPath::Weights:
        if (node.mesh == kNone || document_.meshes[node.mesh].primitives.empty()) return 0;
        return document_.meshes[node.mesh].primitives.front().targets.size();
      default:
        return 3;
    }
  }

  std::vector<float> evaluate(const AnimationChannel& channel, const KeySpan& span, size_t width) {
    const bool isCubic = channel.interpolation == Interpolation::Cubic;
    const std::vector<float>& all = floats(channel.output);
    // Cubic keys hold the in-tangent, the value and the out-tangent.
    const auto part = [&](size_t key, size_t which) {
      return all.data() + (isCubic ? (3 * key + which) : key) * width;
    };
    const float* a = part(span.first, 1);
    const float* b = part(span.second, 1);
    std::vector<float> result(a, a + width);
    if (channel.interpolation == Interpolation::Step || span.first == span.second) return result;
    if (isCubic) {
      hermite(result, b, part(span.first, 2), part(span.second, 0), span);
    } else if (channel.path == AnimatedPath::Rotation) {
      const glm::dquat q = glm::slerp(quaternion(a), quaternion(b), static_cast<double>(span.fraction));
      result = {static_cast<float>(q.x), static_cast<float>(q.y), static_cast<float>(q.z), static_cast<float>(q.w)};
    } else {
      for (size_t i = 0; i < width; ++i) result[i] = glm::mix(a[i], b[i], span.fraction);
    }
    return result;
  }

  static void hermite(std::vector<float>& value, const float* next, const float* out, const float* in,
                      const KeySpan& span) {
    const float t = span.fraction, t2 = t * t, t3 = t2 * t, d = span.duration;
    for (size_t i = 0; i < value.size(); ++i) {
      value[i] = (2 * t3 - 3 * t2 + 1) * value[i] + d * (t3 - 2 * t2 + t) * out[i] + (3 * t2 - 2 * t3) * next[i] +
                 d * (t3 - t2) * in[i];
    }
  }

  static glm::dquat quaternion(const float* v) { return glm::normalize(glm::dquat(v[3], v[0], v[1], v[2])); }

  static void assign(Node& node, AnimatedPath path, const std::vector<float>& value) {
    switch (path) {
      case AnimatedPath::Translation:
        node.translation = glm::dvec3(value[0], value[1], value[2]);
        break;
      case AnimatedPath::Scale:
        node.scale = glm::dvec3(value[0], value[1], value[2]);
        break;
      case AnimatedPath::Weights:
        node.weights = value;
        break;
      case AnimatedPath::Rotation: {
        const glm::dquat q(value[3], value[0], value[1], value[2]);
        if (glm::length(q) > 1e-6) node.rotation = glm::normalize(q);
        break;
      }
    }
  }

  // Each accessor is read once, however many channels share it.
  const std::vector<float>& floats(uint32_t accessor) {
    const auto found = cache_.find(accessor);
    if (found != cache_.end()) return found->second;
    return cache_.emplace(accessor, readFloats(document_, accessor)).first->second;
  }

  Document& document_;
  float time_;
  std::unordered_map<uint32_t, std::vector<float>> cache_;
};

}  // namespace

void animate(Document& document, const Animation& animation, float time) {
  Animator animator(document, time);
  for (const AnimationChannel& channel : animation.channels) animator.apply(channel);
}

double clipSeconds(const Document& document, const Animation& animation) {
  double seconds = 0;
  std::set<uint32_t> inputs;
  for (const AnimationChannel& channel : animation.channels) {
    if (!inputs.insert(channel.input).second || document.accessors[channel.input].count == 0) continue;
    const auto last = static_cast<uint32_t>(document.accessors[channel.input].count - 1);
    const float time = gatherFloats(document, channel.input, std::span(&last, 1)).front();
    if (std::isfinite(time)) seconds = std::max(seconds, static_cast<double>(time));
  }
  return seconds;
}

}  // namespace braid::gltf
