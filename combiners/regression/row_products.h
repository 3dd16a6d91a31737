// SPDX-License-Identifier: Apache-2.0
// Sums of products of the rows of a matrix with each other, the inner loop of normal equations: in blocks of three rows
// by three, nine sums, which every instruction set can hold in registers.
#pragma once

#include <algorithm>
#include <cstddef>

#include "combiners/pixels/simd.h"

namespace braid::regression {

constexpr int kRegisterBlock = 3;

// Two blocks of rows, `pitch` values apart, of `length` values; whole vectors are read.
struct RowBlocks {
  const float *left, *right;
  size_t pitch;
  int length;
};

// sums[3 a + b] += the products of row a of the left block and row b of the right one, lane by lane.
template <int kRows, int kColumns>
void addProducts(const RowBlocks& rows, FloatLanes* sums) {
  FloatLanes s[kRows][kColumns];
  for (int a = 0; a < kRows; ++a) std::copy_n(sums + a * kRegisterBlock, kColumns, s[a]);
  const float* const left[] = {rows.left, rows.left + rows.pitch, rows.left + 2 * rows.pitch};
  const float* const right[] = {rows.right, rows.right + rows.pitch, rows.right + 2 * rows.pitch};
  for (int n = 0; n < rows.length; n += kLanes) {
    FloatLanes factor[kColumns];
    for (int b = 0; b < kColumns; ++b) keepInRegister(factor[b] = loadLanes(right[b] + n));
    for (int a = 0; a < kRows; ++a) {
      FloatLanes other = loadLanes(left[a] + n);
      keepInRegister(other);
      for (int b = 0; b < kColumns; ++b) s[a][b] += other * factor[b];
    }
  }
  for (int a = 0; a < kRows; ++a) std::copy_n(s[a], kColumns, sums + a * kRegisterBlock);
}

// The same for a block with itself: only where b <= a.
inline void addOwnProducts(const RowBlocks& rows, FloatLanes* sums) {
  const float *in0 = rows.left, *in1 = in0 + rows.pitch, *in2 = in1 + rows.pitch;
  FloatLanes s00 = sums[0], s10 = sums[3], s11 = sums[4], s20 = sums[6], s21 = sums[7], s22 = sums[8];
  for (int n = 0; n < rows.length; n += kLanes) {
    FloatLanes a = loadLanes(in0 + n), b = loadLanes(in1 + n), c = loadLanes(in2 + n);
    for (FloatLanes* v : {&a, &b, &c}) keepInRegister(*v);
    s00 += a * a, s10 += b * a, s11 += b * b, s20 += c * a, s21 += c * b, s22 += c * c;
  }
  sums[0] = s00, sums[3] = s10, sums[4] = s11, sums[6] = s20, sums[7] = s21, sums[8] = s22;
}

}  // namespace braid::regression
