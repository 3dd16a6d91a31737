// SPDX-License-Identifier: Apache-2.0
// Distances of pixel triples p - d, p, p + d, for the filters of RDFC (Rousselle et al. 2013, "Robust Denoising using
// Feature and Color Information").
//
// Both neighbours of a triple are tested alone, as in non-local means, and once together: where p differs from either
// but not from their mean, as on a linear ramp, the test of the mean takes over and the ramp is kept.
#pragma once

#include <algorithm>

#include "combiners/denoise/rdfc/rdfc_planes.h"
#include "combiners/denoise/rdfc/rdfc_weights.h"

namespace braid::rdfc {

inline constexpr float kDistanceEpsilon = 1e-10f;
inline constexpr float kFeatureK2 = 0.6f * 0.6f;
inline constexpr float kCoarseFloor = 1e-3f, kFineFloor = 1e-4f;  // of the spread of a feature
inline constexpr float kPerturbation = 0.01f;                     // relative, of the derivative

// What of the spreads s of a pixel and its neighbours goes into a denominator: s_p + s_q, and s_p + (s_q + s_r) / 4 for
// the mean of two neighbours; or 2 s_p where only the pixel's own counts.
enum class Spread { Both, Own };

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

// The same of p and the mean of its neighbours q and r.
template <bool kPerturbed>
inline void addMean(const RdfcTriple<ChannelRow>& rows, float k2, float share, int count, float* __restrict out,
                    float* __restrict change) {
  const ChannelRow &p = rows.both, &q = rows.forward, &r = rows.backward;
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
inline void addFeatureMean(const RdfcTriple<ChannelRow>& rows, float share, int count, float* __restrict outFine,
                           float* __restrict outCoarse) {
  const ChannelRow &p = rows.both, &q = rows.forward, &r = rows.backward;
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

// The triples (x, y) ± (dx, dy) to (x + count - 1, y) ± (dx, dy).
struct TripleRow {
  int dx, dy, x, y, count;
};

// The rows of p, q and r for these triples; with Spread::Own, the neighbours are given the spread of p.
inline RdfcTriple<ChannelRow> neighbourRows(const RdfcChannel& channel, bool feature, Spread spread,
                                            const TripleRow& at) {
  const auto row = [&](int u, int v) {
    const float* variance = channel.variance.at(u, v);
    return ChannelRow{channel.mean.at(u, v), variance, feature ? channel.spread.at(u, v) : variance};
  };
  RdfcTriple<ChannelRow> rows = {row(at.x + at.dx, at.y + at.dy), row(at.x - at.dx, at.y - at.dy), row(at.x, at.y)};
  if (spread == Spread::Own) rows.forward.spread = rows.backward.spread = rows.both.spread;
  return rows;
}
inline float shareOfSpreads(Spread spread) { return spread == Spread::Own ? 0.5f : 0.25f; }

inline void clearRows(const RdfcRows& rows, int count) {
  for (float* row : {rows.forward, rows.backward, rows.both}) std::fill_n(row, count, 0.0f);
}

// Distances of the triples by colour, summed over the channels.
template <bool kPerturbed>
inline void colourRows(const RdfcGuide& guide, float k, Spread spread, const TripleRow& at, const RdfcRows& out,
                       const RdfcRows& change) {
  const int count = at.count;
  clearRows(out, count);
  if (kPerturbed) clearRows(change, count);
  for (const RdfcChannel& channel : guide) {
    const RdfcTriple<ChannelRow> rows = neighbourRows(channel, false, spread, at);
    addPair<kPerturbed>(rows.both, rows.forward, k * k, count, out.forward, change.forward);
    addPair<kPerturbed>(rows.both, rows.backward, k * k, count, out.backward, change.backward);
    addMean<kPerturbed>(rows, k * k, shareOfSpreads(spread), count, out.both, change.both);
  }
}

// The same by a feature. Where the means of neighbours count nowhere, their distances stay 0.
template <bool kCoarse>
inline void featureRows(const RdfcGuide& feature, Spread spread, const TripleRow& at, const RdfcRows& fine,
                        const RdfcRows& coarse) {
  const int count = at.count;
  clearRows(fine, count);
  if (kCoarse) clearRows(coarse, count);
  for (const RdfcChannel& channel : feature) {
    const RdfcTriple<ChannelRow> rows = neighbourRows(channel, true, spread, at);
    addFeaturePair<kCoarse>(rows.both, rows.forward, count, fine.forward, coarse.forward);
    addFeaturePair<kCoarse>(rows.both, rows.backward, count, fine.backward, coarse.backward);
  }
  const float scale = 1.0f / static_cast<float>(feature.size());
  if (!meanMayCount(fine.forward, fine.backward, scale, count) &&
      !(kCoarse && meanMayCount(coarse.forward, coarse.backward, scale, count)))
    return;
  for (const RdfcChannel& channel : feature) {
    const RdfcTriple<ChannelRow> rows = neighbourRows(channel, true, spread, at);
    addFeatureMean<kCoarse>(rows, shareOfSpreads(spread), count, fine.both, coarse.both);
  }
}

}  // namespace braid::rdfc
