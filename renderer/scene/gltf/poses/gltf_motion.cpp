// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/poses/gltf_motion.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "renderer/scene/gltf/document/gltf_accessor.h"

namespace braid::gltf {

namespace {

// Share of its way by which a node may be elsewhere than its animation says.
constexpr double kOff = 1.0 / 256;
// More than that is told.
constexpr double kMuchOff = 1.0 / 64;
constexpr size_t kEven = 32;      // moments that are looked at in any case
constexpr size_t kMostKeys = 64;  // of the animation, besides
constexpr size_t kMostPlaces = size_t(1) << 20;

// A moment that is looked at.
struct Candidate {
  float time;    // of the animation, seconds
  double share;  // of the shutter's seconds
  Pose pose;
};

// Key times of the clip between two moments, ascending.
std::vector<float> keyTimes(const Document& document, int clip, float from, float to) {
  const tinygltf::Animation& animation = document.model.animations[static_cast<size_t>(clip)];
  std::set<int> inputs;
  for (const tinygltf::AnimationChannel& channel : animation.channels)
    if (channel.sampler >= 0) inputs.insert(animation.samplers[static_cast<size_t>(channel.sampler)].input);
  std::set<float> times;
  for (const int input : inputs) {
    if (input < 0 || componentsOf(document.accessor(input)) != 1) continue;
    for (const float t : readFloats(document, input))
      if (t > from && t < to) times.insert(t);
  }
  return {times.begin(), times.end()};
}

double sizeOf(const glm::dmat4& m) {
  return std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]));
}
double turnOf(const glm::dmat4& a, const glm::dmat4& b) { return sizeOf(a - b); }
double wayOf(const glm::dmat4& a, const glm::dmat4& b) { return glm::length(glm::dvec3(a[3] - b[3])); }

double largestDifference(const std::vector<float>& a, const std::vector<float>& b) {
  double largest = 0;
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    largest = std::max(largest, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  return largest;
}

// Chooses moments: first the opening and the closing, then again and again the one at which something is furthest from
// where the straight lines between those chosen have it (Douglas and Peucker 1973).
class Steps {
 public:
  Steps(const std::vector<Candidate>& moments, const std::vector<int>& shown) : moments_(moments) {
    for (const int node : shown) add(static_cast<size_t>(node));
  }
  bool any() const { return !nodes_.empty(); }

  void mark(PoseSequence& sequence) const {
    sequence.moves.assign(moments_[0].pose.world.size(), false);
    sequence.morphs = sequence.moves;
    for (const Node& n : nodes_) {
      sequence.moves[n.index] = sequence.moves[n.index] || n.turn > 0 || n.way > 0;
      sequence.morphs[n.index] = sequence.morphs[n.index] || n.weights > 0;
    }
  }

  // Indices of the chosen moments, ascending; `off`: the share of its way by which something is still elsewhere.
  std::vector<size_t> choose(double& off) const {
    std::vector<size_t> chosen{0, moments_.size() - 1};
    std::vector<double> error(moments_.size(), 0.0);
    measure(0, moments_.size() - 1, error);
    for (;;) {
      const auto worst = std::max_element(error.begin(), error.end());
      off = *worst * kOff;
      if (*worst <= 1 || chosen.size() > kMostPieces) return chosen;
      const auto at = static_cast<size_t>(worst - error.begin());
      const auto next = chosen.insert(std::upper_bound(chosen.begin(), chosen.end(), at), at);
      *worst = 0;
      measure(*(next - 1), at, error);
      measure(at, *(next + 1), error);
    }
  }

 private:
  struct Node {
    size_t index;
    double turn = 0, way = 0, weights = 0;  // the largest distances from the opening
    double size = 0, distance = 0;          // of its axes and its place, to which numbers are rounded
  };

  void add(size_t index) {
    Node n{index};
    const glm::dmat4& at = moments_[0].pose.world[index];
    n.size = sizeOf(at);
    n.distance = glm::length(glm::dvec3(at[3]));
    for (const Candidate& m : moments_) {
      n.turn = std::max(n.turn, turnOf(m.pose.world[index], at));
      n.way = std::max(n.way, wayOf(m.pose.world[index], at));
      n.weights = std::max(n.weights, largestDifference(m.pose.weights[index], moments_[0].pose.weights[index]));
    }
    // What doubles have rounded is no motion.
    constexpr double kRounding = 1e-12;
    if (!(n.turn > kRounding * n.size)) n.turn = 0;
    if (!(n.way > kRounding * (n.size + n.distance))) n.way = 0;
    if (n.turn > 0 || n.way > 0 || n.weights > 0) nodes_.push_back(n);
  }

  // The errors of the moments between two chosen ones, in units of what is allowed.
  void measure(size_t first, size_t last, std::vector<double>& error) const {
    const Candidate &a = moments_[first], &b = moments_[last];
    for (size_t i = first + 1; i < last; ++i) {
      const double length = b.share - a.share;
      const double f = length > 0 ? (moments_[i].share - a.share) / length : 1;
      error[i] = 0;
      for (const Node& n : nodes_) error[i] = std::max(error[i], errorOf(n, moments_[i].pose, {&a.pose, &b.pose, f}));
    }
  }

  struct Line {
    const Pose *from, *to;
    double fraction;
  };
  static double errorOf(const Node& n, const Pose& pose, const Line& line) {
    const double f = line.fraction;
    double error = 0;
    if (n.turn > 0 || n.way > 0) {
      const glm::dmat4 straight = line.from->world[n.index] * (1 - f) + line.to->world[n.index] * f;
      const glm::dmat4& true_ = pose.world[n.index];
      // Keys are floats: what they have rounded is no bend.
      error = std::max(turnOf(true_, straight) / (kOff * n.turn + 1e-6 * n.size),
                       wayOf(true_, straight) / (kOff * n.way + 1e-7 * n.distance + 1e-9 * n.size));
    }
    const std::vector<float>&a = line.from->weights[n.index], &b = line.to->weights[n.index],
          &w = pose.weights[n.index];
    for (size_t i = 0; n.weights > 0 && i < w.size(); ++i) {
      const double straight = static_cast<double>(a[i]) * (1 - f) + static_cast<double>(b[i]) * f;
      error = std::max(error, std::abs(static_cast<double>(w[i]) - straight) / (kOff * n.weights + 1e-6));
    }
    return std::isfinite(error) ? error : 0;
  }

  const std::vector<Candidate>& moments_;
  std::vector<Node> nodes_;  // that move
};

// The moments that are looked at, but for the opening. Just before a key and at it, in case that the value jumps there;
// the closing itself belongs to no path.
std::vector<Candidate> momentsAfter(const Document& document, int clip, float opening, double seconds) {
  const auto closing = static_cast<float>(static_cast<double>(opening) + seconds);
  const size_t most =
      std::clamp<size_t>(kMostPlaces / std::max<size_t>(document.model.nodes.size(), 1), 3, kEven + 2 * kMostKeys);
  const size_t even = std::min(kEven, most);
  std::vector<Candidate> moments;
  const auto add = [&](float time, double share) {
    if (time > opening && time < closing) moments.push_back({time, std::clamp(share, 0.0, 1.0), {}});
  };
  const auto shareOf = [&](float time) { return (static_cast<double>(time) - static_cast<double>(opening)) / seconds; };
  std::vector<float> keys = keyTimes(document, clip, opening, closing);
  const size_t kept = std::min(keys.size(), (most - even) / 2);
  for (size_t i = 0; i < kept; ++i) {
    const float key = keys[i * keys.size() / kept];
    add(std::nextafter(key, opening), shareOf(key));
    add(key, shareOf(key));
  }
  for (size_t i = 1; i < even; ++i) {
    const auto time =
        static_cast<float>(static_cast<double>(opening) + seconds * static_cast<double>(i) / static_cast<double>(even));
    if (!std::binary_search(keys.begin(), keys.end(), time)) add(time, shareOf(time));
  }
  add(std::nextafter(closing, opening), 1);
  std::stable_sort(moments.begin(), moments.end(),
                   [](const Candidate& a, const Candidate& b) { return a.time < b.time; });
  moments.erase(std::unique(moments.begin(), moments.end(),
                            [](const Candidate& a, const Candidate& b) { return a.time == b.time; }),
                moments.end());
  if (!moments.empty()) moments.back().share = 1;
  return moments;
}

// Poses of one document, each as if it were the first.
class Poser {
 public:
  Poser(Document& document, const LoadOptions& options, int clip) : document_(document), options_(options) {
    std::set<int> targets;
    for (const tinygltf::AnimationChannel& c : document.model.animations[static_cast<size_t>(clip)].channels)
      if (c.target_node >= 0) targets.insert(c.target_node);
    for (const int node : targets) rest_.emplace_back(node, document.model.nodes[static_cast<size_t>(node)]);
  }
  Pose at(float time) {
    for (const auto& [node, source] : rest_) document_.model.nodes[static_cast<size_t>(node)] = source;
    options_.frameTime = time;
    return makePose(document_, options_);
  }

 private:
  Document& document_;
  LoadOptions options_;
  std::vector<std::pair<int, tinygltf::Node>> rest_;
};

}  // namespace

PoseSequence posesWhileOpen(Document& document, const LoadOptions& options, const std::vector<int>& shown) {
  PoseSequence sequence;
  const int clip = options.shutter > 0 && options.frameTime ? chosenAnimation(document, options.animation) : -1;
  if (options.frameTime) sequence.motion.seconds = options.shutter;
  if (clip < 0) {
    sequence.first = makePose(document, options);
    return sequence;
  }
  // Each flaw of the animation is told once, by the first pose.
  const Report report = document.report;
  const Usage usage = document.usage;
  const float opening = *options.frameTime;
  std::vector<Candidate> moments = momentsAfter(document, clip, opening, options.shutter);
  Poser poser(document, options, clip);
  for (Candidate& m : moments) m.pose = poser.at(m.time);
  document.report = report;
  document.usage = usage;
  moments.insert(moments.begin(), {opening, 0, poser.at(opening)});

  const Steps steps(moments, shown);
  if (steps.any() && moments.size() > 1) {
    steps.mark(sequence);
    for (const size_t i : steps.choose(sequence.motion.error)) {
      sequence.motion.times.push_back(static_cast<float>(moments[i].share));
      if (i > 0) sequence.later.push_back(std::move(moments[i].pose));
    }
    if (sequence.motion.error > kMuchOff)
      document.report.warn("/animations/" + std::to_string(clip),
                           "more happens while the shutter is open than straight lines between 17 moments tell; "
                           "give a shorter --shutter");
  }
  sequence.first = std::move(moments[0].pose);
  return sequence;
}

}  // namespace braid::gltf
