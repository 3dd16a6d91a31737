// SPDX-License-Identifier: Apache-2.0
// Sums over square windows in constant time a pixel, without subtractions: sums of non-negative values are exact zeros
// or positive.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"

namespace braid {

// Sums of `in` over windows of 2 radius + 1 rows, clamped to [0, count). A "row" is `lanes` neighbouring values at a
// distance of `stride`. The rows are cut into blocks as long as a window; a window is the tail of one block plus the
// head of the next (van Herk 1992, with sums in place of maxima), so two running sums that never forget are enough.
inline void windowSums(const double* in, double* out, size_t count, size_t stride, size_t lanes, size_t radius) {
  const size_t length = 2 * radius + 1;
  std::vector<double> head(count * lanes), tail(count * lanes);
  for (size_t i = 0; i < count; ++i)
    for (size_t l = 0; l < lanes; ++l)
      head[i * lanes + l] = in[i * stride + l] + (i % length == 0 ? 0.0 : head[(i - 1) * lanes + l]);
  for (size_t i = count; i-- > 0;)
    for (size_t l = 0; l < lanes; ++l)
      tail[i * lanes + l] =
          in[i * stride + l] + (i % length == length - 1 || i + 1 == count ? 0.0 : tail[(i + 1) * lanes + l]);
  for (size_t i = 0; i < count; ++i) {
    const size_t first = i > radius ? i - radius : 0, last = std::min(count - 1, i + radius);
    const bool oneBlock = first / length == last / length;
    const double useTail = oneBlock && first % length == 0 ? 0.0 : 1.0;
    const double useHead = oneBlock && first % length != 0 ? 0.0 : 1.0;
    for (size_t l = 0; l < lanes; ++l)
      out[i * stride + l] = useTail * tail[first * lanes + l] + useHead * head[last * lanes + l];
  }
}

// Sums over windows of (2 radius + 1)² pixels, clamped at the borders. The same bits for any number of threads.
template <class T>
Plane<double> boxSum(const Plane<T>& in, int radius) {
  Plane<double> out(in.width, in.height);
  const auto width = static_cast<size_t>(in.width), height = static_cast<size_t>(in.height);
  const auto r = static_cast<size_t>(radius);
  if (in.empty()) return out;
  parallelRows(in.height, [&](int y) {
    const size_t begin = static_cast<size_t>(y) * width;
    std::vector<double> row(in.data.begin() + static_cast<std::ptrdiff_t>(begin),
                            in.data.begin() + static_cast<std::ptrdiff_t>(begin + width));
    windowSums(row.data(), out.data.data() + begin, width, 1, 1, r);
  });
  constexpr size_t kStrip = 64;  // columns at a time: whole cache lines, and scratch that stays in the cache
  parallelChunks(width, kStrip, [&](size_t begin, size_t end) {
    windowSums(out.data.data() + begin, out.data.data() + begin, height, width, end - begin, r);
  });
  return out;
}

}  // namespace braid
