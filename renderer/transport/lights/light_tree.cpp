// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/lights/light_tree.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace braid {

namespace {

// As many floats at once as the processor takes, by the vector extension of gcc and clang; conditions choose lane by
// lane.
#if defined(__AVX__)
constexpr int kWidth = 8;
#else
constexpr int kWidth = 4;
#endif
using Floats = float __attribute__((vector_size(kWidth * sizeof(float))));

// Of a Floats, or of a float.
template <class F>
BRAID_INLINE F larger(const F& a, const F& b) {
  return a < b ? b : a;
}
template <class F>
BRAID_INLINE F smaller(const F& a, const F& b) {
  return b < a ? b : a;
}
BRAID_INLINE Floats root(const Floats& x) {
  Floats r;
  for (int l = 0; l < kWidth; ++l) r[l] = __builtin_sqrtf(x[l]);
  return r;
}
// sqrt(1 - x²), 0 where rounding makes that negative.
BRAID_INLINE Floats otherLeg(const Floats& x) { return root(larger(1 - x * x, Floats{})); }

// The share of the left one of two nodes. A node that may contribute keeps a chance worth a float's digits: the other,
// however bright, may be hidden.
template <class F>
BRAID_INLINE F leftShare(const F& left, const F& right) {
  constexpr float kLeast = 0x1p-10f;
  const F p = left / (left + right), clamped = smaller(larger(p, F{} + kLeast), F{} + (1 - kLeast));
  return left > 0 && right > 0 ? clamped : p;
}

// `probability` times a node's share, or 0 if neither node can contribute.
template <class F>
BRAID_INLINE F timesShare(const F& probability, const F& share, const F& left, const F& right) {
  const F sum = left + right;
  return sum > 0 && sum < kInfinity ? probability * share : F{};
}

// Picks one of two nodes by u, which becomes a fresh variate, without branches: no predictor would learn them. Returns
// whether it is the left one.
template <class F>
BRAID_INLINE auto pickLeft(const F& left, const F& right, F& u, F& probability) {
  const F share = leftShare(left, right);
  const auto isLeft = u < share;
  const F width = isLeft ? share : 1 - share, from = isLeft ? F{} : share;
  u = smaller(larger((u - from) / width, F{}), F{} + kOneMinusEpsilon);
  probability = timesShare(probability, width, left, right);
  return isLeft;
}

// Angles between 0 and pi by their sines and cosines.
struct Angles {
  Floats sine, cosine;
};
// Of max(0, a - b).
BRAID_INLINE Floats cosOfDifference(const Angles& a, const Angles& b) {
  return a.cosine > b.cosine ? Floats{} + 1 : a.cosine * b.cosine + a.sine * b.sine;
}
BRAID_INLINE Floats sinOfDifference(const Angles& a, const Angles& b) {
  return a.cosine > b.cosine ? Floats{} : a.sine * b.cosine - a.cosine * b.sine;
}

// Fetches a group while nothing waits for it.
template <class Group>
BRAID_INLINE void prefetch(const Group& group) {
  for (size_t byte = 0; byte < sizeof(Group); byte += 64)
    __builtin_prefetch(reinterpret_cast<const char*>(&group) + byte);
}

}  // namespace

void LightTree::importances(const Group& group, const LightQuery& query, float (&out)[kLanes]) {
  const Vec3 &p = query.position, &n = query.normal;
  const Floats least = Floats{} + 1e-4f;
  for (int first = 0; first < kLanes; first += kWidth) {
    const auto of = [&](const float(Group::*member)[kLanes]) {
      Floats v;
      std::memcpy(&v, &(group.*member)[first], sizeof(v));
      return v;
    };
    const Floats dx = p.x - of(&Group::centreX), dy = p.y - of(&Group::centreY), dz = p.z - of(&Group::centreZ);
    const Floats radius = of(&Group::radius);
    const Floats distance = root(dx * dx + dy * dy + dz * dz), inverse = 1 / distance;
    const Floats wx = dx * inverse, wy = dy * inverse, wz = dz * inverse;
    const Floats sinBound = radius * inverse;
    const Angles bound{sinBound, otherLeg(sinBound)};

    const Floats along = of(&Group::axisX) * wx + of(&Group::axisY) * wy + of(&Group::axisZ) * wz;
    const Floats cosAxis = of(&Group::twoSided) != 0 ? larger(along, -along) : along;
    const Angles axis{otherLeg(cosAxis), cosAxis}, normals{of(&Group::sinNormals), of(&Group::cosNormals)};
    const Floats cosEmit = cosOfDifference({sinOfDifference(axis, normals), cosOfDifference(axis, normals)}, bound);
    const Floats part = (distance - radius) * of(&Group::inverseRange), part2 = part * part;
    // Slack on the cosines: rounding must not turn a light that contributes a little into one that is never chosen.
    Floats value = of(&Group::power) * (inverse * inverse) * larger(cosEmit, least) * larger(1 - part2 * part2, least);
    value = part > 1 + 1e-5f ? Floats{} : value;
    value = cosEmit <= of(&Group::cosEmission) ? Floats{} : value;
    if (n != Vec3(0)) {
      const Floats facing = -(wx * n.x + wy * n.y + wz * n.z);
      const Floats cosReceive = query.twoSided ? larger(facing, -facing) : facing;
      const Floats received = cosOfDifference({otherLeg(cosReceive), cosReceive}, bound);
      value = received < -1e-5f ? Floats{} : value * larger(received, least);
    }
    value = distance <= radius ? of(&Group::inside) : value;
    std::memcpy(&out[first], &value, sizeof(value));
  }
}

// Queries on their way, as far as the place that each has in the arrays.
struct LightTree::Walks {
  alignas(64) float u[kMostQueries] = {}, probability[kMostQueries] = {};
  uint32_t at[kMostQueries], query[kMostQueries];
  uint8_t lane[kMostQueries];

  // For the walks from `first` on: one of two nodes, whose importances are those of `left` and the next lane.
  void pick(size_t first, const float (&importance)[kTogether][kLanes], const uint8_t (&left)[kTogether]) {
    for (size_t k = 0; k < kTogether; k += kWidth) {
      Floats a, b, own, chance;
      for (size_t l = 0; l < kWidth; ++l) {
        a[l] = importance[k + l][left[k + l]];
        b[l] = importance[k + l][left[k + l] + 1];
      }
      std::memcpy(&own, &u[first + k], sizeof(own));
      std::memcpy(&chance, &probability[first + k], sizeof(chance));
      const auto isLeft = pickLeft(a, b, own, chance);
      std::memcpy(&u[first + k], &own, sizeof(own));
      std::memcpy(&probability[first + k], &chance, sizeof(chance));
      for (size_t l = 0; l < kWidth; ++l) lane[first + k + l] = static_cast<uint8_t>(left[k + l] + 1 + isLeft[l]);
    }
  }
};

void LightTree::sample(LightQuery& query) const {
  float u = query.u;
  query.probability = 1;
  uint32_t at = root_;
  while (!(at & kLeaf) && query.probability > 0) {
    float importance[kLanes];
    importances(groups_[at], query, importance);
    const size_t child = pickLeft(importance[0], importance[1], u, query.probability) ? 0 : 2;
    const size_t left = 2 + child;
    at = groups_[at].next[pickLeft(importance[left], importance[left + 1], u, query.probability) ? child : child + 1];
  }
  query.light = at & ~kLeaf;
}

void LightTree::sample(std::span<LightQuery> queries) const {
  for (; queries.size() > kMostQueries; queries = queries.subspan(kMostQueries)) sample(queries.first(kMostQueries));
  Walks walks;
  for (size_t i = 0; i < queries.size(); ++i) {
    queries[i].light = root_ & ~kLeaf;
    queries[i].probability = 1;
    walks.u[i] = queries[i].u;
    walks.probability[i] = 1;
    walks.at[i] = root_;
    walks.query[i] = static_cast<uint32_t>(i);
  }
  for (size_t count = root_ & kLeaf ? 0 : queries.size(); count > 0;) {
    size_t alive = 0;
    for (size_t first = 0; first < count; first += kTogether)
      alive = step(walks, first, std::min(count, first + kTogether), alive, queries);
    count = alive;
  }
}

size_t LightTree::step(Walks& walks, size_t first, size_t end, size_t alive, std::span<LightQuery> queries) const {
  float importance[kTogether][kLanes] = {};  // of no walk: 0, for arithmetic on what memory held may be slow
  uint8_t left[kTogether] = {};
  for (size_t w = first; w < end; ++w)
    importances(groups_[walks.at[w]], queries[walks.query[w]], importance[w - first]);
  walks.pick(first, importance, left);
  for (size_t w = first; w < end; ++w) left[w - first] = static_cast<uint8_t>(2 + 2 * walks.lane[w]);
  walks.pick(first, importance, left);
  for (size_t w = first; w < end; ++w) {
    const uint32_t next = groups_[walks.at[w]].next[walks.lane[w] - 2];
    LightQuery& query = queries[walks.query[w]];
    query.light = next & ~kLeaf;
    query.probability = walks.probability[w];
    walks.u[alive] = walks.u[w];
    walks.probability[alive] = walks.probability[w];
    walks.query[alive] = walks.query[w];
    walks.at[alive] = next;
    const bool goesOn = (next & kLeaf) == 0 && query.probability > 0;
    if (goesOn) prefetch(groups_[next]);
    alive += goesOn;
  }
  return alive;
}

float LightTree::probability(const LightQuery& query, uint32_t light) const {
  const uint32_t target = position_[light];
  if (target == ~0u) return 0;
  float result = 1;
  for (uint32_t at = root_; !(at & kLeaf) && result > 0;) {
    const Group& group = groups_[at];
    float importance[kLanes];
    importances(group, query, importance);
    const uint32_t child = target >= group.rightLeaves[0], right = target >= group.rightLeaves[1 + child];
    const auto take = [&](float a, float b, bool isRight) {
      const float share = leftShare(a, b);
      result = timesShare(result, isRight ? 1 - share : share, a, b);
    };
    take(importance[0], importance[1], child != 0);
    take(importance[2 + 2 * child], importance[3 + 2 * child], right != 0);
    at = group.next[2 * child + right];
  }
  return result;
}

}  // namespace braid
