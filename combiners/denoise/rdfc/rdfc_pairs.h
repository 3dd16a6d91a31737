// SPDX-License-Identifier: Apache-2.0
// Distances and weights of pixel triples p - d, p, p + d, for the filters of RDFC (Rousselle et al. 2013, "Robust
// Denoising using Feature and Color Information").
//
// Both neighbours of a triple are tested alone, as in non-local means, and once together: where p differs from either
// but not from their mean, as on a linear ramp, the test of the mean takes over and the ramp is kept.
//
// Everything works on rows and within mirrored planes, whose margin is as wide as windows and patches reach: no row
// needs to know where the image ends. Rows are rounded up to whole vectors; what is too much is computed from the
// margin and never used.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "combiners/pixels/window.h"
#include "combiners/pixels/mirror.h"
#include "renderer/core/plane.h"

namespace braid {

inline constexpr int kRdfcMargin = 32;  // >= window + patch + radius of the weights' box + kRdfcRowUnit
inline constexpr int kRdfcRowUnit = 16;
inline constexpr int kRdfcTileWidth = 128, kRdfcTileHeight = 16;
constexpr int rdfcRowCount(int n) { return (n + kRdfcRowUnit - 1) / kRdfcRowUnit * kRdfcRowUnit; }

// A plane mirrored at its borders.
class MirroredPlane {
 public:
  MirroredPlane() = default;
  explicit MirroredPlane(const Plane<float>& plane) : padded_(mirrorPadded(plane, kRdfcMargin)) {}
  const float* at(int x, int y) const { return padded_.data.data() + padded_.index(x + kRdfcMargin, y + kRdfcMargin); }
  int width() const { return padded_.width - 2 * kRdfcMargin; }
  int height() const { return padded_.height - 2 * kRdfcMargin; }

 private:
  Plane<float> padded_;
};

// One channel of what pixels are compared by.
struct RdfcChannel {
  MirroredPlane mean, variance;  // variance of the mean
  MirroredPlane spread;          // of a feature: what its denominator knows; else empty
};

// One group of channels: the colour, or a feature.
using RdfcGuide = std::vector<RdfcChannel>;

// Three values, or rows of them: for p + d, for p - d, and for the mean of both.
template <class T>
struct RdfcTriple {
  T forward, backward, both;
};
using RdfcRows = RdfcTriple<float*>;

namespace rdfc {

inline constexpr float kDistanceEpsilon = 1e-10f;
inline constexpr float kFeatureK2 = 0.6f * 0.6f;
inline constexpr float kCoarseFloor = 1e-3f, kFineFloor = 1e-4f;  // of the spread of a feature
inline constexpr float kMostDistance = 25;                        // of either neighbour, for the mean to count
inline constexpr float kLeastOwnWeight = 1e-3f;                   // of a pixel with itself
inline constexpr float kPerturbation = 0.01f;                     // relative, of the derivative

// What of the spreads s of a pixel and its neighbours goes into a denominator: s_p + s_q, and s_p + (s_q + s_r) / 4 for
// the mean of two neighbours; or 2 s_p where only the pixel's own counts.
enum class Spread { Both, Own };

// By value: std::max() of two array elements chooses between addresses, which keeps loops from being vectorised.
inline float larger(float a, float b) { return a > b ? a : b; }
inline float smaller(float a, float b) { return a < b ? a : b; }

// Pointers to one row of one channel, at p or at a neighbour.
struct ChannelRow {
  const float *mean, *variance, *spread;
};

// (u_p - u_q)² - (V_p + min(V_p, V_q)), and the same for the mean of q and r.
inline float excess(float difference, float vp, float vq) { return difference * difference - (vp + smaller(vp, vq)); }
inline float excess(float difference, float vp, float vq, float vr) {
  return difference * difference - (vp + 0.25f * (smaller(vp, vq) + smaller(vp, vr)));
}

// out += the distance excess / (eps + k² (V_p + V_q)) of p and q. change += what that grows by where u_p is 1 % larger.
template <bool kPerturbed>
inline void addPair(const ChannelRow& p, const ChannelRow& q, float k2, int count, float* __restrict out,
                    float* __restrict change) {
  const float* __restrict up = p.mean, * __restrict uq = q.mean;
  const float *vp = p.variance, *vq = q.variance, *sq = q.spread;
  for (int x = 0; x < count; ++x) {
    const float difference = up[x] - uq[x];
    const float inverse = 1.0f / (kDistanceEpsilon + k2 * (vp[x] + sq[x]));
    out[x] += excess(difference, vp[x], vq[x]) * inverse;
    if constexpr (kPerturbed) {
      const float more = kPerturbation * up[x];
      change[x] += more * (2 * difference + more) * inverse;
    }
  }
}

// The same of p and the mean of q and r.
template <bool kPerturbed>
inline void addMean(const ChannelRow& p, const ChannelRow& q, const ChannelRow& r, float k2, float share, int count,
                    float* __restrict out, float* __restrict change) {
  const float* __restrict up = p.mean, * __restrict uq = q.mean, * __restrict ur = r.mean;
  const float *vp = p.variance, *vq = q.variance, *vr = r.variance, *sq = q.spread, *sr = r.spread;
  for (int x = 0; x < count; ++x) {
    const float difference = up[x] - 0.5f * (uq[x] + ur[x]);
    const float inverse = 1.0f / (kDistanceEpsilon + k2 * (vp[x] + share * (sq[x] + sr[x])));
    out[x] += excess(difference, vp[x], vq[x], vr[x]) * inverse;
    if constexpr (kPerturbed) {
      const float more = kPerturbation * up[x];
      change[x] += more * (2 * difference + more) * inverse;
    }
  }
}

// The distances of features with spread max(s, floor) in place of the variance, for both floors or the fine one. One
// division serves both: 1 / a = b / (a b).
template <bool kCoarse>
inline void addFeature(float above, float fine, float coarse, float& outFine, float& outCoarse) {
  fine = kDistanceEpsilon + kFeatureK2 * fine;
  if constexpr (kCoarse) {
    coarse = kDistanceEpsilon + kFeatureK2 * coarse;
    const float scaled = above / (fine * coarse);
    outFine += scaled * coarse;
    outCoarse += scaled * fine;
  } else {
    outFine += above / fine;
  }
}

template <bool kCoarse>
inline void addFeaturePair(const ChannelRow& p, const ChannelRow& q, int count, float* __restrict outFine,
                           float* __restrict outCoarse) {
  const float* __restrict up = p.mean, * __restrict uq = q.mean;
  const float* __restrict vp = p.variance, * __restrict vq = q.variance;
  const float *sp = p.spread, *sq = q.spread;
  for (int x = 0; x < count; ++x)
    addFeature<kCoarse>(excess(up[x] - uq[x], vp[x], vq[x]), larger(sp[x], kFineFloor) + larger(sq[x], kFineFloor),
                        larger(sp[x], kCoarseFloor) + larger(sq[x], kCoarseFloor), outFine[x],
                        (kCoarse ? outCoarse : outFine)[x]);
}

template <bool kCoarse>
inline void addFeatureMean(const ChannelRow& p, const ChannelRow& q, const ChannelRow& r, float share, int count,
                           float* __restrict outFine, float* __restrict outCoarse) {
  const float* __restrict up = p.mean, * __restrict uq = q.mean, * __restrict ur = r.mean;
  const float* __restrict vp = p.variance, * __restrict vq = q.variance, * __restrict vr = r.variance;
  const float *sp = p.spread, *sq = q.spread, *sr = r.spread;
  for (int x = 0; x < count; ++x)
    addFeature<kCoarse>(
        excess(up[x] - 0.5f * (uq[x] + ur[x]), vp[x], vq[x], vr[x]),
        larger(sp[x], kFineFloor) + share * (larger(sq[x], kFineFloor) + larger(sr[x], kFineFloor)),
        larger(sp[x], kCoarseFloor) + share * (larger(sq[x], kCoarseFloor) + larger(sr[x], kCoarseFloor)), outFine[x],
        (kCoarse ? outCoarse : outFine)[x]);
}

// The rows of p, q and r for a triple; with Spread::Own, the neighbours are given the spread of p.
inline RdfcTriple<ChannelRow> neighbourRows(const RdfcChannel& channel, bool feature, Spread spread, int dx, int dy,
                                            int x, int y) {
  const auto row = [&](int u, int v) {
    const float* variance = channel.variance.at(u, v);
    return ChannelRow{channel.mean.at(u, v), variance, feature ? channel.spread.at(u, v) : variance};
  };
  RdfcTriple<ChannelRow> rows = {row(x + dx, y + dy), row(x - dx, y - dy), row(x, y)};
  if (spread == Spread::Own) rows.forward.spread = rows.backward.spread = rows.both.spread;
  return rows;
}
inline float shareOfSpreads(Spread spread) { return spread == Spread::Own ? 0.5f : 0.25f; }

inline void clearRows(const RdfcRows& rows, int count) {
  for (float* row : {rows.forward, rows.backward, rows.both}) std::fill_n(row, count, 0.0f);
}

// Distances by colour of the triples (x, y) ± (dx, dy) to (x + count - 1, y) ± (dx, dy), summed over the channels.
template <bool kPerturbed>
inline void colourRows(const RdfcGuide& guide, float k, Spread spread, int dx, int dy, int x, int y, int count,
                       const RdfcRows& out, const RdfcRows& change) {
  clearRows(out, count);
  if (kPerturbed) clearRows(change, count);
  for (const RdfcChannel& channel : guide) {
    const RdfcTriple<ChannelRow> rows = neighbourRows(channel, false, spread, dx, dy, x, y);
    addPair<kPerturbed>(rows.both, rows.forward, k * k, count, out.forward, change.forward);
    addPair<kPerturbed>(rows.both, rows.backward, k * k, count, out.backward, change.backward);
    addMean<kPerturbed>(rows.both, rows.forward, rows.backward, k * k, shareOfSpreads(spread), count, out.both,
                        change.both);
  }
}

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

// The same by a feature. Where the means of neighbours count nowhere, their distances stay 0.
template <bool kCoarse>
inline void featureRows(const RdfcGuide& feature, Spread spread, int dx, int dy, int x, int y, int count,
                        const RdfcRows& fine, const RdfcRows& coarse) {
  clearRows(fine, count);
  if (kCoarse) clearRows(coarse, count);
  for (const RdfcChannel& channel : feature) {
    const RdfcTriple<ChannelRow> rows = neighbourRows(channel, true, spread, dx, dy, x, y);
    addFeaturePair<kCoarse>(rows.both, rows.forward, count, fine.forward, coarse.forward);
    addFeaturePair<kCoarse>(rows.both, rows.backward, count, fine.backward, coarse.backward);
  }
  const float scale = 1.0f / static_cast<float>(feature.size());
  if (!meanMayCount(fine.forward, fine.backward, scale, count) &&
      !(kCoarse && meanMayCount(coarse.forward, coarse.backward, scale, count)))
    return;
  for (const RdfcChannel& channel : feature) {
    const RdfcTriple<ChannelRow> rows = neighbourRows(channel, true, spread, dx, dy, x, y);
    addFeatureMean<kCoarse>(rows.both, rows.forward, rows.backward, shareOfSpreads(spread), count, fine.both,
                            coarse.both);
  }
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
// Of three targets.
inline void addWeighted3(const float* __restrict forward, const float* __restrict backward, const float* __restrict q0,
                         const float* __restrict q1, const float* __restrict q2, const float* __restrict r0,
                         const float* __restrict r1, const float* __restrict r2, int count, float* __restrict s0,
                         float* __restrict s1, float* __restrict s2) {
  for (int x = 0; x < count; ++x) {
    const float f = forward[x], b = backward[x];
    s0[x] += f * q0[x] + b * r0[x];
    s1[x] += f * q1[x] + b * r1[x];
    s2[x] += f * q2[x] + b * r2[x];
  }
}

// Sums and maxima of weights.
inline void addWeights(const float* __restrict forward, const float* __restrict backward, int count,
                       float* __restrict sum, float* __restrict most) {
  for (int x = 0; x < count; ++x) {
    sum[x] += forward[x] + backward[x];
    most[x] = larger(most[x], larger(forward[x], backward[x]));
  }
}

}  // namespace rdfc

// The offsets of a window, one of each pair ±d.
template <class Body>
inline void forEachRdfcOffset(int window, const Body& body) {
  for (int dy = -window; dy <= 0; ++dy)
    for (int dx = -window; dx <= (dy == 0 ? -1 : window); ++dx) body(dx, dy);
}

}  // namespace braid
