// SPDX-License-Identifier: Apache-2.0
// Sums over all windows of one length of a line, without subtractions: sums of non-negative values are exact zeros or
// positive. Written for runVectorised().
#pragma once

#include <algorithm>
#include <utility>

namespace braid {

// out[i] += in[i]
template <class T>
void addValues(const T* __restrict in, int count, T* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] += in[i];
}

// out[i] = the sum of the n values from in[i] on, put together from sums of 1, 2, 4, … of them. `in` holds
// count + n - 1 values and is overwritten, as is `spare`, of the same size.
template <class T>
void windowSums(T* in, T* spare, int count, int n, T* out) {
  std::fill_n(out, count, T(0));
  for (int power = 1, at = 0;; power *= 2) {
    if (n & power) {
      addValues(in + at, count, out);
      at += power;
    }
    if (2 * power > n) return;
    const T* __restrict first = in, * __restrict second = in + power;
    T* __restrict both = spare;
    for (int i = 0; i < count + n - 2 * power; ++i) both[i] = first[i] + second[i];
    std::swap(in, spare);
  }
}

}  // namespace braid
