// SPDX-License-Identifier: Apache-2.0
// Russian roulette: paths that carry little are ended at random, and those that go on make up for them.
#pragma once

#include <algorithm>
#include <limits>

namespace braid {

// From `start` segments on, a path whose throughput, relative to that of its start, is below `level` goes on with
// probability throughput / level. A level of 1 ends a path by what each of its surfaces absorbs; below it, paths are
// left whole until they carry little, and then all carry alike: less noise where surfaces are bright, less time where
// they are dark.
struct Roulette {
  static constexpr int kNever = std::numeric_limits<int>::max();

  int start = 1;
  float level = 0.2f;  // of camera paths (combiners/EXPERIMENTS.md, Russian roulette by throughput)

  // Probability with which a path goes on; `relative` is its throughput, the compression of radiance by refraction
  // undone.
  float survival(int segments, float relative) const {
    return segments >= start ? std::min(1.0f, relative / level) : 1.0f;
  }
};

}  // namespace braid
