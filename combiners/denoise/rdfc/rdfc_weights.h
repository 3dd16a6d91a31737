// SPDX-License-Identifier: Apache-2.0
// Weights from the distances of pixel triples (rdfc_pairs.h), and sums weighted with them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "combiners/denoise/rdfc/rdfc_planes.h"
#include "combiners/pixels/window.h"

namespace braid::rdfc {

inline constexpr float kMostDistance = 25;       // of either neighbour, for the mean to count
inline constexpr float kLeastOwnWeight = 1e-3f;  // of a pixel with itself

// By value: std::max() of two array elements chooses between addresses, which keeps loops from being vectorised.
inline float larger(float a, float b) { return a > b ? a : b; }
inline float smaller(float a, float b) { return a < b ? a : b; }

// exp(-m) > exp(-f) + exp(-b), for f and b > 0, takes m < (f + b) / 2 - log 2 and m < min(f, b). What the distance m of
// the mean of two neighbours has to be below for it to count; a little more, for rounding, and 0 where it never does.
inline float limitOfMean(float f, float b) {
  const float limit = smaller(smaller(f, b), 0.5f * (f + b) - 0.69f);
  return smaller(f, b) > 0 && larger(f, b) < kMostDistance ? limit : 0.0f;
}

// Whether the mean of the neighbours may count anywhere; `scale` turns sums into distances.
inline bool meanMayCount(const float* __restrict forward, const float* __restrict backward, float scale, int count) {
  int any = 0;
  for (int x = 0; x < count; ++x) any |= limitOfMean(scale * forward[x], scale * backward[x]) > 0;
  return any != 0;
}
inline bool meanCounts(const RdfcRows& distance, float scale, int count) {
  const float* __restrict df = distance.forward, * __restrict db = distance.backward, * __restrict dm = distance.both;
  int any = 0;
  for (int x = 0; x < count; ++x) any |= larger(scale * dm[x], 0) < limitOfMean(scale * df[x], scale * db[x]);
  return any != 0;
}

inline float weightOf(float distance) { return exp2NonPositive(distance > 0 ? -kLog2E * distance : 0.0f); }

// 0 instead of weights below 2^-60: their products with colours would be subnormal, which processors take a hundred
// times longer over.
inline float withoutTiny(float weight) { return weight > 0x1p-60f ? weight : 0.0f; }

// How much the test of the mean counts: 0 unless its weight is larger than those of both neighbours together.
inline float shareOfMean(float forward, float backward, float both, float distanceF, float distanceB) {
  const float a = both / (forward + backward) - 1;
  const bool near = distanceF < kMostDistance && distanceB < kMostDistance;
  return near ? smaller(1.0f, larger(0.0f, a)) : 0.0f;
}

// forward and backward become the smaller of themselves and the weights of the distances times `scale`.
inline void minWithWeights(const RdfcRows& distance, float scale, int count, float* __restrict forward,
                           float* __restrict backward) {
  const float* __restrict df = distance.forward, * __restrict db = distance.backward, * __restrict dm = distance.both;
  for (int x = 0; x < count; ++x) {
    const float f = scale * df[x], b = scale * db[x];
    const float wf = weightOf(f), wb = weightOf(b), wm = weightOf(scale * dm[x]);
    const float a = shareOfMean(wf, wb, wm, f, b);
    forward[x] = withoutTiny(smaller(forward[x], wf + a * (wm - wf)));
    backward[x] = withoutTiny(smaller(backward[x], wb + a * (wm - wb)));
  }
}

inline void keepLargest(const float* __restrict distance, float scale, int count, float* __restrict largest) {
  for (int x = 0; x < count; ++x) largest[x] = larger(largest[x], scale * distance[x]);
}

inline void minWithWeight(const float* __restrict distance, int count, float* __restrict weight) {
  for (int x = 0; x < count; ++x) weight[x] = withoutTiny(smaller(weight[x], weightOf(distance[x])));
}

// The smallest weight over features, collected as the largest distance as long as the means of neighbours do not count:
// exponentials are what costs.
class SmallestWeight {
 public:
  explicit SmallestWeight(size_t width) {
    for (auto& row : rows_) row.resize(width);
  }
  float* forward() { return rows_[0].data(); }
  float* backward() { return rows_[1].data(); }
  // Where a feature's distances go, before add().
  RdfcRows distance() { return {rows_[4].data(), rows_[5].data(), rows_[6].data()}; }

  void clear(int count) {
    for (size_t k : {0, 1}) std::fill_n(rows_[k].data(), count, 1.0f);
    for (size_t k : {2, 3}) std::fill_n(rows_[k].data(), count, 0.0f);
  }
  void add(float scale, int count) {
    if (meanCounts(distance(), scale, count)) {
      minWithWeights(distance(), scale, count, forward(), backward());
    } else {
      keepLargest(distance().forward, scale, count, rows_[2].data());
      keepLargest(distance().backward, scale, count, rows_[3].data());
    }
  }
  void finish(int count) {
    minWithWeight(rows_[2].data(), count, forward());
    minWithWeight(rows_[3].data(), count, backward());
  }

 private:
  std::array<std::vector<float>, 7> rows_;
};

// out[x] = in[x] + ... + in[x + 2 radius] for radius 1, 2 or 3.
template <int kRadius>
inline void boxRow(const float* __restrict in, int count, float* __restrict out) {
  for (int x = 0; x < count; ++x) {
    float sum = in[x];
    for (int k = 1; k <= 2 * kRadius; ++k) sum += in[x + k];
    out[x] = sum;
  }
}

// out[x] = the sum of 2 radius + 1 rows from `first` on, `pitch` apart.
template <int kRadius>
inline void boxColumn(const float* __restrict first, ptrdiff_t pitch, int count, float* __restrict out) {
  for (int x = 0; x < count; ++x) {
    float sum = first[x];
    for (int k = 1; k <= 2 * kRadius; ++k) sum += first[x + k * pitch];
    out[x] = sum;
  }
}

// sum += forward q + backward r: the two neighbours of a target.
inline void addWeighted(const float* __restrict forward, const float* __restrict backward, const float* __restrict q,
                        const float* __restrict r, int count, float* __restrict sum) {
  for (int x = 0; x < count; ++x) sum[x] += forward[x] * q[x] + backward[x] * r[x];
}

// Sums and maxima of weights.
inline void addWeights(const float* __restrict forward, const float* __restrict backward, int count,
                       float* __restrict sum, float* __restrict most) {
  for (int x = 0; x < count; ++x) {
    sum[x] += forward[x] + backward[x];
    most[x] = larger(most[x], larger(forward[x], backward[x]));
  }
}

}  // namespace braid::rdfc
