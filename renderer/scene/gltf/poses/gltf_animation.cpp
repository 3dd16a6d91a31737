// SPDX-License-Identifier: Apache-2.0
// Animation channels evaluated at one moment: STEP, LINEAR and CUBICSPLINE, clamped outside their keys.
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <unordered_map>

#include "renderer/scene/gltf/document/gltf_accessor.h"
#include "renderer/scene/gltf/poses/gltf_pose.h"

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

  void apply(const tinygltf::Animation& animation, const tinygltf::AnimationChannel& channel,
             const std::string& place) {
    const std::optional<std::vector<double>> value =
        valueOf(animation, channel, animatedWidth(document_, channel), place);
    if (!value) return;
    tinygltf::Node& node = document_.model.nodes[static_cast<size_t>(channel.target_node)];
    if (!node.matrix.empty() && channel.target_path != "weights") {
      document_.report.warn(place, "an animated node has a matrix; it stays at rest");
      return;
    }
    assign(node, channel.target_path, *value);
  }

  // None: the channel says nothing.
  std::optional<std::vector<double>> valueOf(const tinygltf::Animation& animation,
                                             const tinygltf::AnimationChannel& channel, size_t width,
                                             const std::string& place) {
    if (channel.sampler < 0) return {};
    const tinygltf::AnimationSampler& sampler = animation.samplers[static_cast<size_t>(channel.sampler)];
    document_.useAccessor(sampler.input);
    document_.useAccessor(sampler.output);
    if (width == 0 || sampler.input < 0 || sampler.output < 0) return {};
    // Broken accessors have no values.
    const std::vector<float>& times = floats(sampler.input);
    const size_t perKey = (sampler.interpolation == "CUBICSPLINE" ? 3 : 1) * width;
    if (times.empty() || floats(sampler.output).size() < times.size() * perKey || !isOrdered(place, sampler.input))
      return {};
    std::vector<double> value = evaluate(sampler, channel, findKeys(times, time_), width);
    if (std::all_of(value.begin(), value.end(), [](double v) { return std::isfinite(v); })) return value;
    document_.report.warn(place, "an animation yields values that are not finite; its target stays at rest");
    return {};
  }

 private:
  enum class Order { Increasing, Jumping, Broken };

  static Order orderOf(const std::vector<float>& times) {
    Order order = Order::Increasing;
    for (size_t i = 0; i < times.size(); ++i) {
      if (!std::isfinite(times[i]) || (i > 0 && times[i] < times[i - 1])) return Order::Broken;
      if (i > 0 && times[i] == times[i - 1]) order = Order::Jumping;
    }
    return order;
  }

  // Two keys at one time are a jump, which many programs write. Times that go back say nothing.
  bool isOrdered(const std::string& place, int accessor) {
    const auto found = order_.find(accessor);
    const Order order =
        found != order_.end() ? found->second : order_.emplace(accessor, orderOf(floats(accessor))).first->second;
    if (order == Order::Broken)
      document_.report.warn(place, "the key times of an animation do not increase; it is ignored");
    if (order == Order::Jumping)
      document_.report.warn(place, "an animation has two keys at one time; the value jumps there");
    return order != Order::Broken;
  }

  std::vector<double> evaluate(const tinygltf::AnimationSampler& sampler, const tinygltf::AnimationChannel& channel,
                               const KeySpan& span, size_t width) {
    const bool isCubic = sampler.interpolation == "CUBICSPLINE";
    const std::vector<float>& all = floats(sampler.output);
    // Cubic keys hold the in-tangent, the value and the out-tangent.
    const auto part = [&](size_t key, size_t which) {
      const float* first = all.data() + (isCubic ? (3 * key + which) : key) * width;
      return std::vector<double>(first, first + width);
    };
    std::vector<double> a = part(span.first, 1);
    if (sampler.interpolation == "STEP" || span.first == span.second) return a;
    const std::vector<double> b = part(span.second, 1);
    const double f = static_cast<double>(span.fraction);
    if (isCubic) {
      hermite(a, b, part(span.first, 2), part(span.second, 0), span);
    } else if (channel.target_path == "rotation") {
      const glm::dquat q = glm::slerp(quaternion(a.data()), quaternion(b.data()), f);
      a = {q.x, q.y, q.z, q.w};
    } else {
      for (size_t i = 0; i < width; ++i) a[i] = glm::mix(a[i], b[i], f);
    }
    return a;
  }

  static void hermite(std::vector<double>& value, const std::vector<double>& next, const std::vector<double>& out,
                      const std::vector<double>& in, const KeySpan& span) {
    const double t = static_cast<double>(span.fraction), t2 = t * t, t3 = t2 * t,
                 d = static_cast<double>(span.duration);
    for (size_t i = 0; i < value.size(); ++i) {
      value[i] = (2 * t3 - 3 * t2 + 1) * value[i] + d * (t3 - 2 * t2 + t) * out[i] + (3 * t2 - 2 * t3) * next[i] +
                 d * (t3 - t2) * in[i];
    }
  }

  static void assign(tinygltf::Node& node, const std::string& path, const std::vector<double>& value) {
    if (path == "translation") node.translation = value;
    if (path == "rotation") node.rotation = value;
    if (path == "scale") node.scale = value;
    if (path == "weights") node.weights = value;
  }

  // Each accessor is read once, however many channels share it.
  const std::vector<float>& floats(int accessor) {
    const auto found = cache_.find(accessor);
    if (found != cache_.end()) return found->second;
    return cache_.emplace(accessor, readFloats(document_, accessor)).first->second;
  }

  Document& document_;
  float time_;
  std::unordered_map<int, std::vector<float>> cache_;
  std::unordered_map<int, Order> order_;  // of key times
};

// Whether the values of a channel come in so many numbers each; weights are written one by one.
bool hasShape(const Document& document, const tinygltf::Animation& animation, const tinygltf::AnimationChannel& channel,
              size_t width) {
  if (channel.sampler < 0) return true;
  const int output = animation.samplers[static_cast<size_t>(channel.sampler)].output;
  if (output < 0 || document.accessor(output).count == 0) return true;
  const size_t components = componentsOf(document.accessor(output));
  return components == 1 || components == width;
}

}  // namespace

size_t animatedWidth(const Document& document, const tinygltf::AnimationChannel& channel) {
  const std::string& path = channel.target_path;
  if (channel.target_node < 0) return 0;
  if (path == "rotation") return 4;
  if (path == "translation" || path == "scale") return 3;
  if (path != "weights") return 0;
  const int mesh = document.model.nodes[static_cast<size_t>(channel.target_node)].mesh;
  if (mesh < 0 || document.model.meshes[static_cast<size_t>(mesh)].primitives.empty()) return 0;
  return document.model.meshes[static_cast<size_t>(mesh)].primitives.front().targets.size();
}

void animate(Document& document, int clip, float time) {
  Animator animator(document, time);
  document.usage.mark("animations", clip);
  const tinygltf::Animation& animation = document.model.animations[static_cast<size_t>(clip)];
  for (size_t c = 0; c < animation.channels.size(); ++c) {
    const std::string place = "/animations/" + std::to_string(clip) + "/channels/" + std::to_string(c);
    animator.apply(animation, animation.channels[c], place);
  }
}

std::vector<std::optional<std::vector<double>>> animatedValues(Document& document, int clip, float time) {
  Animator animator(document, time);
  std::vector<std::optional<std::vector<double>>> values;
  for (const AnimatedProperty& property : document.properties) {
    values.emplace_back();
    if (property.clip != clip) continue;
    const tinygltf::Animation& animation = document.model.animations[static_cast<size_t>(clip)];
    const tinygltf::AnimationChannel& channel = animation.channels[static_cast<size_t>(property.channel)];
    const std::string place = "/animations/" + std::to_string(clip) + "/channels/" + std::to_string(property.channel);
    if (hasShape(document, animation, channel, property.width))
      values.back() = animator.valueOf(animation, channel, property.width, place);
    else
      document.report.warn(place, "its values have another shape than what its pointer leads to; it stays at rest");
  }
  return values;
}

double clipSeconds(const Document& document, const tinygltf::Animation& animation) {
  double seconds = 0;
  std::set<int> inputs;
  for (const tinygltf::AnimationSampler& sampler : animation.samplers) {
    if (sampler.input < 0 || !inputs.insert(sampler.input).second) continue;
    const Accessor& times = document.accessor(sampler.input);
    if (times.count == 0 || times.count > kNone || componentsOf(times) != 1) continue;
    const auto last = static_cast<uint32_t>(times.count - 1);
    const float time = gatherFloats(document, sampler.input, std::span(&last, 1)).front();
    if (std::isfinite(time)) seconds = std::max(seconds, static_cast<double>(time));
  }
  return seconds;
}

}  // namespace braid::gltf
