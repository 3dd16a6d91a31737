// SPDX-License-Identifier: Apache-2.0
// Parallel loops over fixed chunks: what a chunk holds never depends on the number of threads, so results do not
// either.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <tbb/parallel_for.h>

namespace braid {

// Calls body(begin, end) for consecutive chunks of `chunk` items of [0, count). Chunks run in any order on any thread.
template <class Body>
void parallelChunks(size_t count, size_t chunk, const Body& body) {
  const size_t chunks = (count + chunk - 1) / chunk;
  tbb::parallel_for(size_t(0), chunks, [&](size_t c) { body(c * chunk, std::min(count, (c + 1) * chunk)); });
}

// Calls body(y) for every row of an image.
template <class Body>
void parallelRows(int height, const Body& body) {
  tbb::parallel_for(0, height, body);
}

// Sums map(begin, end) over fixed chunks, added in chunk order: the same bits for any number of threads.
template <class T, class Map>
T parallelSum(size_t count, size_t chunk, T zero, const Map& map) {
  const size_t chunks = (count + chunk - 1) / chunk;
  std::vector<T> partial(chunks, zero);
  tbb::parallel_for(size_t(0), chunks,
                    [&](size_t c) { partial[c] = map(c * chunk, std::min(count, (c + 1) * chunk)); });
  T total = zero;
  for (const T& p : partial) total += p;
  return total;
}

}  // namespace braid
