// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/raw_sums.h"

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

void addSums(const RawSums& to, const RawSums& from) {
  BRAID_ASSERT(to.size() == from.size());
  for (size_t p = 0; p < to.size(); ++p) {
    Plane<double>& sum = *to[p].plane;
    const Plane<double>& more = *from[p].plane;
    BRAID_ASSERT(to[p].name == from[p].name && sum.width == more.width && sum.height == more.height);
    parallelChunks(sum.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) sum[i] += more[i];
    });
  }
}

}  // namespace braid
