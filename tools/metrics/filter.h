// SPDX-License-Identifier: Apache-2.0
// Separable filters with replicated borders: rows in parallel, taps outside and pixels inside so that the loops
// vectorise.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"

namespace braid {

// Correlation along x with an odd number of taps.
template <class T>
Plane<T> filterRows(const Plane<T>& in, const std::vector<T>& taps) {
  Plane<T> out(in.width, in.height);
  const auto width = static_cast<size_t>(in.width);
  const size_t radius = taps.size() / 2;
  parallelRows(in.height, [&](int y) {
    const T* row = &in.at(0, y);
    std::vector<T> padded(width + 2 * radius, row[0]);
    std::copy_n(row, width, padded.begin() + static_cast<std::ptrdiff_t>(radius));
    std::fill_n(padded.end() - static_cast<std::ptrdiff_t>(radius), radius, row[width - 1]);
    T* __restrict to = &out.at(0, y);
    for (size_t k = 0; k < taps.size(); ++k) {
      const T* __restrict from = padded.data() + k;
      const T tap = taps[k];
      for (size_t x = 0; x < width; ++x) to[x] += tap * from[x];
    }
  });
  return out;
}

// Correlation along y with an odd number of taps, added to `out`.
template <class T>
void addFilteredColumns(const Plane<T>& in, const std::vector<T>& taps, Plane<T>& out) {
  const auto width = static_cast<size_t>(in.width);
  const int radius = static_cast<int>(taps.size() / 2);
  parallelRows(in.height, [&](int y) {
    T* __restrict to = &out.at(0, y);
    for (int k = -radius; k <= radius; ++k) {
      const T* __restrict from = &in.at(0, std::clamp(y + k, 0, in.height - 1));
      const T tap = taps[static_cast<size_t>(k + radius)];
      for (size_t x = 0; x < width; ++x) to[x] += tap * from[x];
    }
  });
}

template <class T>
Plane<T> filterColumns(const Plane<T>& in, const std::vector<T>& taps) {
  Plane<T> out(in.width, in.height);
  addFilteredColumns(in, taps, out);
  return out;
}

}  // namespace braid
