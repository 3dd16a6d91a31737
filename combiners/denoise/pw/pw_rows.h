// SPDX-License-Identifier: Apache-2.0
// The loops over rows of the patch-Welch filter; see pw_filter.h. To be compiled for each instruction set with what
// calls them, hence inline.
#pragma once

#include <array>
#include <cstddef>
#include <cstring>
#include <vector>

#include "combiners/denoise/pw/pw_filter.h"
#include "combiners/denoise/pw/pw_tile.h"
#include "combiners/pixels/window.h"
#include "renderer/core/pixel_buffer.h"

namespace braid {

// Rows are computed in whole vectors; what is too much is never used.
inline constexpr int kRowUnit = PatchWelchTile::kUnit;
constexpr int wholeVectors(int n) { return roundUp(n, kRowUnit); }

using Rows3 = std::array<const float*, 3>;

inline Rows3 rowsAt(const PatchWelchTile::Plane3& planes, ptrdiff_t at) {
  return {planes[0].data() + at, planes[1].data() + at, planes[2].data() + at};
}

using Lanes = float __attribute__((vector_size(kRowUnit * sizeof(float))));
using LanesInMemory = float __attribute__((vector_size(kRowUnit * sizeof(float)), aligned(alignof(float)), may_alias));

// By reference: how wide vectors are returned depends on the instruction set.
inline const LanesInMemory& lanesAt(const float* row) { return *reinterpret_cast<const LanesInMemory*>(row); }

// Of each image, out = the sum over the channels of (u_p - u_q)² / (V_p + V_q + eps), for a multiple of kRowUnit pixels
// from p on. All images at once: the processor divides while it computes the rest.
template <size_t kImages>
void differenceRows(const PatchWelchTile& tile, ptrdiff_t p, ptrdiff_t q, int count, float* const* out) {
  const Rows3 vp = rowsAt(tile.variance, p), vq = rowsAt(tile.variance, q);
  Rows3 up[kImages], uq[kImages];
  for (size_t i = 0; i < kImages; ++i) {
    up[i] = rowsAt(tile.radiance[i], p);
    uq[i] = rowsAt(tile.radiance[i], q);
  }
  for (int x = 0; x < count; x += kRowUnit) {
    const Lanes r0 = 1.0f / ((lanesAt(vp[0] + x) + lanesAt(vq[0] + x)) + kPatchWelchEpsilon);
    const Lanes r1 = 1.0f / ((lanesAt(vp[1] + x) + lanesAt(vq[1] + x)) + kPatchWelchEpsilon);
    const Lanes r2 = 1.0f / ((lanesAt(vp[2] + x) + lanesAt(vq[2] + x)) + kPatchWelchEpsilon);
#pragma GCC unroll 3
    for (size_t i = 0; i < kImages; ++i) {
      const Lanes d0 = lanesAt(up[i][0] + x) - lanesAt(uq[i][0] + x);
      const Lanes d1 = lanesAt(up[i][1] + x) - lanesAt(uq[i][1] + x);
      const Lanes d2 = lanesAt(up[i][2] + x) - lanesAt(uq[i][2] + x);
      const Lanes sum = (d0 * d0 * r0 + d1 * d1 * r1) + d2 * d2 * r2;
      std::memcpy(out[i] + x, &sum, sizeof(sum));
    }
  }
}

// out = the sum of the three values around each; of in[-1] on.
inline void boxRow(const float* __restrict in, int count, float* __restrict out) {
  const float* __restrict left = in - 1;
  for (int x = 0; x < count; ++x) out[x] = (left[x] + left[x + 1]) + left[x + 2];
}

// out = max(0, 1 - s / t²) with s / t² = (a + b + c) inverseCount scale; whether any is positive. Not-a-number counts
// as no.
inline bool toleranceRow(const Rows3& rows, const float* __restrict inverseCount, float scale, int count,
                         float* __restrict out) {
  const float* __restrict a = rows[0], * __restrict b = rows[1], * __restrict c = rows[2];
  int any = 0;
  for (int x = 0; x < count; ++x) {
    const float t = 1.0f - ((a[x] + b[x]) + c[x]) * (inverseCount[x] * scale);
    out[x] = t > 0 ? t : 0.0f;
    any |= t > 0;
  }
  return any != 0;
}

// out = 2^(spatial - |guide_p - guide_q|²)
inline void edgeRow(const PatchWelchTile& tile, ptrdiff_t p, ptrdiff_t q, float spatial, int count,
                    float* __restrict out) {
  const auto& g = tile.guide;
  const float* __restrict p0 = g[0].data() + p, * __restrict q0 = g[0].data() + q;
  const float* __restrict p1 = g[1].data() + p, * __restrict q1 = g[1].data() + q;
  const float* __restrict p2 = g[2].data() + p, * __restrict q2 = g[2].data() + q;
  const float* __restrict p3 = g[3].data() + p, * __restrict q3 = g[3].data() + q;
  const float* __restrict p4 = g[4].data() + p, * __restrict q4 = g[4].data() + q;
  const float* __restrict p5 = g[5].data() + p, * __restrict q5 = g[5].data() + q;
  for (int x = 0; x < count; ++x) {
    const float d0 = p0[x] - q0[x], d1 = p1[x] - q1[x], d2 = p2[x] - q2[x];
    const float d3 = p3[x] - q3[x], d4 = p4[x] - q4[x], d5 = p5[x] - q5[x];
    const float albedo = (d0 * d0 + d1 * d1) + d2 * d2, normal = (d3 * d3 + d4 * d4) + d5 * d5;
    out[x] = exp2NonPositive(spatial - (albedo + normal));
  }
}

inline void weightRow(float* __restrict tolerance, const float* __restrict edge, int count) {
  for (int x = 0; x < count; ++x) tolerance[x] = tolerance[x] * tolerance[x] * edge[x];
}

// Sums of w and of w u for the pixels of a tile, row by row.
struct WeightedSums {
  std::array<PixelBuffer<float>, 4> plane;  // weight, then red, green, blue
};

// A row of weights and of the pixels that they belong to.
struct WeightedRow {
  const float* w;
  Rows3 u;
};

// Adds w and w u of all rows to the sums of kUnits vectors of a row.
template <int kUnits>
void addColumns(const std::vector<WeightedRow>& rows, int x, WeightedSums& sums, ptrdiff_t at) {
  Lanes sum[4][kUnits];
  for (size_t k = 0; k < 4; ++k)
    for (int n = 0; n < kUnits; ++n) sum[k][n] = lanesAt(sums.plane[k].data() + at + x + n * kRowUnit);
  for (const WeightedRow& row : rows)
#pragma GCC unroll 4
    for (int n = 0; n < kUnits; ++n) {
      const Lanes w = lanesAt(row.w + x + n * kRowUnit);
      sum[0][n] += w;
      sum[1][n] += w * lanesAt(row.u[0] + x + n * kRowUnit);
      sum[2][n] += w * lanesAt(row.u[1] + x + n * kRowUnit);
      sum[3][n] += w * lanesAt(row.u[2] + x + n * kRowUnit);
    }
  for (size_t k = 0; k < 4; ++k)
    for (int n = 0; n < kUnits; ++n)
      std::memcpy(sums.plane[k].data() + at + x + n * kRowUnit, &sum[k][n], sizeof(Lanes));
}

// The same of a row of `count` pixels, a multiple of kRowUnit; of as many vectors at once as there are registers for.
inline void addRows(const std::vector<WeightedRow>& rows, int count, WeightedSums& sums, ptrdiff_t at) {
  int x = 0;
  if (vectorLevel() == VectorLevel::Avx512)
    for (; x + 4 * kRowUnit <= count; x += 4 * kRowUnit) addColumns<4>(rows, x, sums, at);
  for (; x < count; x += kRowUnit) addColumns<1>(rows, x, sums, at);
}

}  // namespace braid
