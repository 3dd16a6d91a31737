// SPDX-License-Identifier: Apache-2.0
#include "integrators/bidirectional/merge_grid.h"

#include <bit>

namespace braid {

// Counting sort in the order of the vertices, which does not depend on threads.
MergeGrid::MergeGrid(std::vector<MergeVertex> vertices, float radius)
    : radius_(radius), inverseCell_(0.5f / radius), vertices_(vertices.size()) {
  const auto buckets = std::bit_ceil(std::max<uint32_t>(static_cast<uint32_t>(vertices.size()), 16));
  mask_ = buckets - 1;
  start_.assign(size_t(buckets) + 1, 0);
  std::vector<uint32_t> bucket(vertices.size());
  for (size_t i = 0; i < vertices.size(); ++i) {
    bucket[i] = bucketOf(cellOf(vertices[i].position));
    ++start_[bucket[i] + 1];
  }
  for (size_t b = 0; b < buckets; ++b) start_[b + 1] += start_[b];
  std::vector<uint32_t> next(start_.begin(), start_.end() - 1);
  for (size_t i = 0; i < vertices.size(); ++i) vertices_[next[bucket[i]]++] = vertices[i];
}

}  // namespace braid
